// One draft on the stage: its meshes, the planes with its drawings, and every way
// to show them.

import {
  Box3,
  CanvasTexture,
  DoubleSide,
  EqualStencilFunc,
  FrontSide,
  Group,
  type Material,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  NotEqualStencilFunc,
  type Object3D,
  ReplaceStencilOp,
  SRGBColorSpace,
  type Texture,
  Vector3,
} from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { shaded } from "../lib/shade";
import { type Viewpoint, planeName } from "../lib/viewpoint";

export type Surface = "clay" | "confidence" | "drawings";

/** The files of one draft. */
export interface DraftFiles {
  solid: ArrayBuffer;
  textured: ArrayBuffer | null;
}

export interface Draft {
  root: Group;
  clay: Mesh[];
  textured: Object3D[];
  /** Planes with the drawings, by names as `ref_045`. */
  planes: Map<string, Mesh>;
  height: number;
  centre: Vector3;
  radius: number;
  /** The farthest from its turning axis, seen from above. */
  reach: number;
}

/** How drafts are shown. */
export interface Look {
  surface: Surface;
  wireframe: boolean;
  overlay: { view: Viewpoint; opacity: number } | null;
}

/** Of pixels that the draft covers. */
const COVERED = 1;
const MARKS_COVERED = { stencilWrite: true, stencilRef: COVERED, stencilZPass: ReplaceStencilOp } as const;
/** What is drawn and not in the draft, and the other way round. */
const DRAWN_ONLY = [47, 107, 255, 255] as const;
const DRAFT_ONLY = [224, 85, 27, 255] as const;
/** Of the draft where nothing is drawn. */
const PAPER = 0xcfd3dc;
/** As drawings lie over the draft, whatever is nearer. */
const OVERLAID = { transparent: true, depthTest: false, depthWrite: false, side: DoubleSide } as const;

const meshesOf = (root: Object3D): Mesh[] => {
  const found: Mesh[] = [];
  root.traverse((node) => {
    if (node instanceof Mesh) found.push(node);
  });
  return found;
};

function textureOf(canvas: OffscreenCanvas): Texture {
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  // As glTF has its textures.
  texture.flipY = false;
  return texture;
}

async function parse(bytes: ArrayBuffer): Promise<Group> {
  return (await new GLTFLoader().parseAsync(bytes, "")).scene;
}

/** Reads the files of a draft; its drawings are hidden at first. */
export async function loaded(files: DraftFiles): Promise<Draft> {
  const solid = await parse(files.solid);
  const textured = files.textured ? await parse(files.textured) : null;
  const root = new Group();
  const clay = meshesOf(solid);
  const planes = new Map<string, Mesh>();
  const body: Object3D[] = [];
  for (const node of [...(textured?.children ?? [])]) {
    if (!node.name.startsWith("ref_")) {
      body.push(node);
      continue;
    }
    for (const plane of meshesOf(node)) {
      const { map } = plane.material as MeshBasicMaterial;
      plane.material = new MeshBasicMaterial({ map, ...OVERLAID });
      plane.renderOrder = 10;
      plane.visible = false;
      planes.set(node.name, plane);
    }
  }
  for (const mesh of body.flatMap(meshesOf)) {
    // The file's colours take no light, for renderers of all kinds; here the form is seen in shades.
    const { map } = mesh.material as MeshBasicMaterial;
    const flatShading = !mesh.geometry.hasAttribute("normal");
    mesh.material = new MeshLambertMaterial({ map, color: PAPER, flatShading, ...MARKS_COVERED });
  }
  root.add(solid);
  if (textured) root.add(textured);
  const box = new Box3();
  for (const mesh of clay) {
    box.expandByObject(mesh);
    mesh.userData["confidence"] = mesh.geometry.getAttribute("color");
  }
  const size = box.getSize(new Vector3());
  return {
    root,
    clay,
    textured: body,
    planes,
    height: size.y,
    centre: box.getCenter(new Vector3()),
    radius: size.length() / 2,
    reach: Math.hypot(size.x, size.z) / 2,
  };
}

/** Whether its vertices say how sure each place is. */
export const hasConfidence = (draft: Draft) => draft.clay.some((mesh) => Boolean(mesh.userData["confidence"]));

/** Shows a draft as it should look. */
export function dress(draft: Draft, { surface, wireframe, overlay }: Look): void {
  const textured = surface === "drawings" && draft.textured.length > 0;
  for (const node of draft.textured) node.visible = textured;
  for (const mesh of draft.clay) {
    mesh.visible = !textured || wireframe;
    const colours = surface === "confidence" ? mesh.userData["confidence"] : null;
    if (colours) mesh.geometry.setAttribute("color", colours as never);
    (mesh.material as Material).dispose();
    mesh.material = new MeshLambertMaterial({
      color: colours ? 0xffffff : PAPER,
      vertexColors: Boolean(colours),
      side: FrontSide,
      wireframe,
      flatShading: false,
      ...MARKS_COVERED,
    });
  }
  for (const [name, plane] of draft.planes) {
    plane.visible = overlay !== null && name === planeName(overlay.view) && overlay.opacity > 0;
    if (overlay) (plane.material as MeshBasicMaterial).opacity = overlay.opacity;
  }
}

/** Lays over the plane of a drawing what is drawn and not in the draft, and the other way round. */
export function differences(plane: Mesh, silhouette: ImageBitmap): Mesh[] {
  return ([[true, DRAWN_ONLY], [false, DRAFT_ONLY]] as const).map(([inside, colour]) => {
    const mesh = plane.clone();
    mesh.visible = true;
    mesh.renderOrder = 11;
    mesh.material = new MeshBasicMaterial({
      map: textureOf(shaded(silhouette, colour, inside)),
      ...OVERLAID,
      stencilWrite: true,
      stencilFunc: inside ? NotEqualStencilFunc : EqualStencilFunc,
      stencilRef: COVERED,
    });
    plane.parent?.add(mesh);
    return mesh;
  });
}

/** Takes such meshes away. */
export function undone(meshes: Mesh[]): void {
  for (const mesh of meshes) {
    mesh.removeFromParent();
    const material = mesh.material as MeshBasicMaterial;
    material.map?.dispose();
    material.dispose();
  }
}
