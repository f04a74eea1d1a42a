//! Options of the method `turntable`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the method `turntable` does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct TurntableOptions {
    /// Whether drawings that are off in place or size are moved to fit the
    /// others; how well they agree is reported in any case.
    pub register: bool,
    /// Whether textured.glb has each drawing as a plane behind the model.
    pub reference_planes: bool,
    pub silhouette: SilhouetteOptions,
    pub depth: DepthOptions,
    pub solid: SolidOptions,
}

impl Default for TurntableOptions {
    fn default() -> Self {
        Self {
            register: true,
            reference_planes: true,
            silhouette: SilhouetteOptions::default(),
            depth: DepthOptions::default(),
            solid: SolidOptions::default(),
        }
    }
}

/// How silhouettes are found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SilhouetteOptions {
    /// The widest gap in an outline that is closed before the outside is
    /// filled, px. 0 closes none.
    #[schemars(range(max = 64))]
    pub max_gap_px: u32,
    /// Give opposite views one silhouette, the second mirrored.
    pub join_opposites: bool,
}

impl Default for SilhouetteOptions {
    fn default() -> Self {
        Self { max_gap_px: 10, join_opposites: true }
    }
}

/// What the depth maps of views are read from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthFrom {
    /// The solid, where the views bound it well from three sides or more; else
    /// the lines.
    #[default]
    Auto,
    /// The view's own lines, where neighbours are near enough to match them.
    Lines,
    /// The solid that lines and outlines made.
    Solid,
}

/// How depth maps are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthOptions {
    /// The widest angle to a neighbouring view whose lines are matched, degrees.
    #[schemars(range(min = 1.0, max = 45.0))]
    pub max_neighbour_deg: f64,
    /// The angle that is best to match over where views are denser, degrees.
    #[schemars(range(min = 0.5, max = 45.0))]
    pub preferred_neighbour_deg: f64,
    /// How often the surface is solved again with what other views say.
    #[schemars(range(max = 10))]
    pub refinements: u32,
    /// What depth maps are read from in the end.
    pub from: DepthFrom,
}

impl Default for DepthOptions {
    fn default() -> Self {
        Self {
            max_neighbour_deg: 20.0,
            preferred_neighbour_deg: 5.0,
            refinements: 3,
            from: DepthFrom::Auto,
        }
    }
}

/// How the solid is found from the silhouettes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolidKind {
    /// The visual hull slice by slice, rounded where no line says it is sharp.
    #[default]
    Creased,
    /// The plain visual hull slice by slice.
    Hull,
    /// An octree carved by the silhouettes, and marching cubes.
    Voxel,
}

/// Whether something is done: by what the drawings show, always, or never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the schema describes it")]
pub enum Switch {
    #[default]
    Auto,
    On,
    Off,
}

/// Which closed regions of the drawings are holes through the subject.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Holes {
    /// Those that the opposite view shows too, or where it is not drawn a view
    /// from the side that sees through them; that are ringed thinly and that no
    /// other view contradicts. None in painted drawings and cut-outs, where paper
    /// or alpha tells what one sees through.
    #[default]
    Auto,
    /// Also those that no view can confirm.
    Eager,
    /// Only those of masks and alpha channels.
    Off,
}

/// How the solid is built and meshed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolidOptions {
    /// How the solid is found.
    pub kind: SolidKind,
    /// Whether corners that are drawn as lines stay sharp.
    pub creases: bool,
    /// Whether corners that no view can judge are sharp, as of furniture and
    /// buildings: front and side alone cannot tell a box from a cylinder. By
    /// itself where most of the outlines runs straight up or across.
    pub boxy: Switch,
    /// Whether views are added that show the subject in a mirror.
    pub symmetry: Switch,
    /// Which closed regions are holes.
    pub holes: Holes,
    /// Whether parts are dropped that no outline needs and no line shows.
    pub drop_ghosts: bool,
    /// Whether parts that stand before others are cut to the lines around them.
    pub parts: bool,
    /// Whether depth maps carve the solid.
    pub fusion: bool,
    /// Whether what a network learned from shapes and models decides what the
    /// drawings leave open; by itself unless the solid, drawn again, then leaves
    /// outlines uncovered or has steps where no line is drawn.
    pub prior: Switch,
    /// Cells along the solid's longest side, at least a pixel each.
    #[schemars(range(min = 16, max = 512))]
    pub resolution: u32,
    /// The largest number of triangles.
    #[schemars(range(min = 100, max = 1_000_000))]
    pub target_faces: u32,
    /// Faces are merged as long as the surface stays within this distance, px.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub tolerance_px: f64,
    /// Pieces below this share of the largest piece's volume are dropped, percent.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub min_piece_percent: f64,
}

impl Default for SolidOptions {
    fn default() -> Self {
        Self {
            kind: SolidKind::default(),
            creases: true,
            boxy: Switch::Auto,
            symmetry: Switch::default(),
            holes: Holes::default(),
            drop_ghosts: true,
            parts: true,
            fusion: true,
            prior: Switch::Auto,
            resolution: 192,
            target_faces: 10_000,
            tolerance_px: 0.25,
            min_piece_percent: 0.1,
        }
    }
}
