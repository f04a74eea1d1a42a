// The models of a draft that the 3D view shows.

import { type Viewpoint, viewpointName } from "./viewpoint";

export interface DraftPaths {
  /** `solid.glb`, or the hull of the method that has none. */
  solid: string;
  textured: string | null;
  /** The silhouette of the drawing of a view. */
  silhouette: (view: Viewpoint) => string;
}

/** The models of the job at `path` with these artifacts; null where it made none. */
export function modelsOf(path: string, names: Set<string>): DraftPaths | null {
  const of = (name: string) => `${path}/artifacts/${name}`;
  const solid = ["solid.glb", "hull.glb"].find((name) => names.has(name));
  if (!solid) return null;
  return {
    solid: of(solid),
    textured: names.has("textured.glb") ? of("textured.glb") : null,
    silhouette: (view) => of(`views/${viewpointName(view)}/silhouette.png`),
  };
}
