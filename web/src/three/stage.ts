// The stage: a draft in its frame (metres, Y up, front +Z), seen freely or from
// exactly where a drawing was drawn. Frames are drawn only when something changed.

import {
  AmbientLight,
  BufferGeometry,
  Color,
  DirectionalLight,
  GridHelper,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  type Material,
  Mesh,
  OrthographicCamera,
  PerspectiveCamera,
  Raycaster,
  Scene,
  Spherical,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { type Viewpoint, planeName } from "../lib/viewpoint";
import {
  type Draft,
  type DraftFiles,
  type Look,
  type Surface,
  differences,
  dress,
  hasConfidence,
  loaded,
  undone,
} from "./draft";
import { Pace, isSoftware } from "./pace";

export interface Colours {
  background: string;
  grid: string;
  accent: string;
}

const FOV = 32;

export class Stage {
  #renderer: WebGLRenderer;
  #scene = new Scene();
  #perspective = new PerspectiveCamera(FOV, 1, 0.01, 200);
  #flat = new OrthographicCamera(-1, 1, 1, -1, -100, 200);
  #controls: OrbitControls;
  #drafts: Draft[] = [];
  #isFlat = false;
  #look: Look = { surface: "clay", wireframe: false, overlay: null };
  #turning = false;
  /** Where the first draft ends and the second begins, share of the width. */
  #split: number | null = null;
  #difference: Mesh[] = [];
  #grid: GridHelper | null = null;
  #showGrid = true;
  /** How long a square of the grid is, metres. */
  cell = 1;
  #measured: Vector3[] = [];
  #line: Line;
  #measuring: ((metres: number | null, points: number) => void) | null = null;
  #colours: Colours;
  #frame = 0;
  #last = 0;
  #observer: ResizeObserver;
  #down = new Vector2();
  #pace = new Pace(() => this.#resize());

  constructor(
    readonly canvas: HTMLCanvasElement,
    colours: Colours,
    /** Told when a person turned away from a drawn angle. */
    private readonly onFree: () => void,
  ) {
    this.#colours = colours;
    this.#renderer = new WebGLRenderer({ canvas, antialias: !isSoftware(), stencil: true });
    this.#controls = this.#controlsOf(this.#perspective);
    this.#scene.add(new HemisphereLight(0xffffff, 0x8d97ab, 1.5), new AmbientLight(0xffffff, 0.35));
    const key = new DirectionalLight(0xffffff, 1.7);
    key.position.set(2, 4, 5);
    const rim = new DirectionalLight(0xffffff, 0.7);
    rim.position.set(-4, 2, -5);
    this.#scene.add(key, rim);
    this.#line = new Line(
      new BufferGeometry(),
      new LineBasicMaterial({ color: colours.accent, depthTest: false }),
    );
    this.#line.renderOrder = 20;
    this.#line.visible = false;
    this.#scene.add(this.#line);
    this.#observer = new ResizeObserver(() => this.#resize());
    this.#observer.observe(canvas.parentElement ?? canvas);
    canvas.addEventListener("pointerdown", this.#pointerDown);
    canvas.addEventListener("pointerup", this.#pointerUp);
    this.recolour(colours);
    this.#resize();
  }

  /** Puts a draft on the stage, beside one that is there already. */
  async add(files: DraftFiles): Promise<void> {
    const draft = await loaded(files);
    this.#drafts.push(draft);
    this.#scene.add(draft.root);
    if (this.#drafts.length === 1) {
      this.#buildGrid(draft);
      this.reset();
    }
    this.#apply();
  }

  get hasTextures(): boolean {
    return this.#drafts.some((draft) => draft.textured.length > 0);
  }

  /** Whether a draft says how sure each place of it is. */
  get hasConfidence(): boolean {
    return this.#drafts.some(hasConfidence);
  }

  get #main(): Draft | undefined {
    return this.#drafts[0];
  }

  get #camera(): PerspectiveCamera | OrthographicCamera {
    return this.#isFlat ? this.#flat : this.#perspective;
  }

  recolour(colours: Colours): void {
    this.#colours = colours;
    this.#scene.background = new Color(colours.background);
    (this.#line.material as LineBasicMaterial).color.set(colours.accent);
    if (this.#main) this.#buildGrid(this.#main);
    this.invalidate();
  }

  /** Back to the first look: a little from the side and above. */
  reset(): void {
    this.#isFlat = false;
    this.#place(28, 78);
  }

  /** Looks exactly as at a drawing: from where it was drawn and without perspective. */
  lookAt({ azimuth, elevation }: Viewpoint): void {
    this.#isFlat = true;
    this.#place(azimuth, 90 - elevation);
  }

  setFlat(flat: boolean): void {
    if (flat === this.#isFlat) return;
    const at = new Spherical().setFromVector3(
      this.#camera.position.clone().sub(this.#controls.target),
    );
    this.#isFlat = flat;
    this.#place((at.theta * 180) / Math.PI, (at.phi * 180) / Math.PI);
  }

  /** Turns the camera by so many degrees, as the arrow keys do. */
  turn(around: number, up: number): void {
    const offset = this.#camera.position.clone().sub(this.#controls.target);
    const at = new Spherical().setFromVector3(offset);
    at.theta += (around * Math.PI) / 180;
    at.phi = Math.min(Math.PI - 0.02, Math.max(0.02, at.phi - (up * Math.PI) / 180));
    this.#camera.position.copy(this.#controls.target).add(offset.setFromSpherical(at));
    this.#controls.update();
    this.onFree();
    this.invalidate();
  }

  zoom(factor: number): void {
    if (this.#isFlat) {
      this.#flat.zoom *= factor;
      this.#flat.updateProjectionMatrix();
    } else {
      const target = this.#controls.target;
      this.#perspective.position.sub(target).multiplyScalar(1 / factor).add(target);
    }
    this.#controls.update();
    this.invalidate();
  }

  setSurface(surface: Surface): void {
    this.#look.surface = surface;
    this.#apply();
  }

  setWireframe(on: boolean): void {
    this.#look.wireframe = on;
    this.#apply();
  }

  setGrid(on: boolean): void {
    this.#showGrid = on;
    if (this.#grid) this.#grid.visible = on;
    this.invalidate();
  }

  setTurning(on: boolean): void {
    this.#turning = on;
    if (on) this.onFree();
    this.invalidate();
  }

  /** Lays the drawing of a view over the draft; null takes it away. */
  setOverlay(view: Viewpoint | null, opacity: number): void {
    this.#look.overlay = view && { view, opacity };
    this.#apply();
  }

  hasDrawing(view: Viewpoint): boolean {
    return this.#main?.planes.has(planeName(view)) ?? false;
  }

  /** Colours where the draft and the silhouette of a view's drawing differ; null ends it. */
  setDifference(shown: { view: Viewpoint; silhouette: ImageBitmap } | null): void {
    undone(this.#difference);
    const plane = shown && this.#main?.planes.get(planeName(shown.view));
    this.#difference = plane ? differences(plane, shown.silhouette) : [];
    this.invalidate();
  }

  setSplit(share: number | null): void {
    this.#split = share;
    this.invalidate();
  }

  /** Measures between two points that a person clicks; null ends it. */
  setMeasuring(told: ((metres: number | null, points: number) => void) | null): void {
    this.#measuring = told;
    this.#measured = [];
    this.#line.visible = false;
    this.canvas.classList.toggle("measuring", told !== null);
    this.invalidate();
  }

  dispose(): void {
    cancelAnimationFrame(this.#frame);
    this.#pace.dispose();
    this.#observer.disconnect();
    this.#controls.dispose();
    this.canvas.removeEventListener("pointerdown", this.#pointerDown);
    this.canvas.removeEventListener("pointerup", this.#pointerUp);
    this.#scene.traverse((node) => {
      if (!(node instanceof Mesh)) return;
      node.geometry.dispose();
      for (const material of [node.material].flat() as Material[]) material.dispose();
    });
    this.#renderer.dispose();
  }

  /** Draws a frame soon. */
  invalidate(): void {
    if (this.#frame === 0) this.#frame = requestAnimationFrame(this.#draw);
  }

  #controlsOf(camera: PerspectiveCamera | OrthographicCamera): OrbitControls {
    const controls = new OrbitControls(camera, this.canvas);
    controls.enableDamping = false;
    controls.addEventListener("change", () => this.invalidate());
    controls.addEventListener("start", () => {
      if (!this.#measuring) this.onFree();
    });
    return controls;
  }

  #place(azimuth: number, polar: number): void {
    const draft = this.#main;
    if (!draft) return;
    const distance = this.#distance(draft);
    const radians = (azimuth * Math.PI) / 180;
    const phi = (Math.min(179.99, Math.max(0.01, polar)) * Math.PI) / 180;
    const camera = this.#camera;
    camera.position
      .setFromSpherical(new Spherical(distance, phi, radians))
      .add(draft.centre);
    this.#flat.zoom = 1;
    const target = draft.centre.clone();
    this.#controls.dispose();
    this.#controls = this.#controlsOf(camera);
    this.#controls.target.copy(target);
    this.#resize();
    this.#controls.update();
    this.invalidate();
  }

  /** From how far all of a draft is seen: on narrow screens its width asks for more. */
  #distance(draft: Draft): number {
    const half = (FOV * Math.PI) / 360;
    const across = Math.atan(Math.tan(half) * Math.min(1, this.#perspective.aspect));
    return Math.max((draft.radius * 1.12) / Math.sin(half), (draft.reach * 1.12) / Math.sin(across));
  }

  #resize(): void {
    const host = this.canvas.parentElement ?? this.canvas;
    const width = Math.max(1, host.clientWidth);
    const height = Math.max(1, host.clientHeight);
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * this.#pace.sharpness);
    this.#renderer.setSize(width, height, false);
    const aspect = width / height;
    const draft = this.#main;
    const before = draft && this.#distance(draft);
    this.#perspective.aspect = aspect;
    this.#perspective.updateProjectionMatrix();
    // What was seen of it stays in sight.
    if (draft && before) {
      const { target } = this.#controls;
      this.#perspective.position.sub(target).multiplyScalar(this.#distance(draft) / before).add(target);
    }
    const half = draft ? Math.max(draft.radius * 1.05, (draft.radius * 1.05) / aspect) : 1;
    Object.assign(this.#flat, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    this.#flat.updateProjectionMatrix();
    this.invalidate();
  }

  #buildGrid(draft: Draft): void {
    if (this.#grid) {
      this.#scene.remove(this.#grid);
      this.#grid.dispose();
    }
    this.cell = 10 ** Math.round(Math.log10(draft.height / 6)) * 2;
    const count = 2 * Math.ceil((draft.radius * 1.6) / this.cell);
    const grid = new GridHelper(count * this.cell, count, this.#colours.grid, this.#colours.grid);
    grid.position.y = draft.centre.y - draft.height / 2;
    grid.visible = this.#showGrid;
    this.#grid = grid;
    this.#scene.add(grid);
  }

  #apply(): void {
    for (const draft of this.#drafts) dress(draft, this.#look);
    this.invalidate();
  }

  #draw = (now: number): void => {
    this.#frame = 0;
    this.#pace.frame(now - this.#last);
    if (this.#turning) {
      const passed = Math.min(100, now - (this.#last || now));
      const offset = this.#camera.position.clone().sub(this.#controls.target);
      const at = new Spherical().setFromVector3(offset);
      at.theta += (passed / 1000) * 0.7;
      this.#camera.position.copy(this.#controls.target).add(offset.setFromSpherical(at));
      this.#camera.lookAt(this.#controls.target);
      this.#frame = requestAnimationFrame(this.#draw);
    }
    this.#last = now;
    const [first, second] = this.#drafts;
    if (first && second && this.#split !== null) {
      const size = this.#renderer.getSize(new Vector2());
      const at = Math.round(size.x * this.#split);
      this.#renderer.setScissorTest(true);
      for (const [shown, hidden, left, width] of [
        [first, second, 0, at],
        [second, first, at, size.x - at],
      ] as const) {
        shown.root.visible = true;
        hidden.root.visible = false;
        this.#renderer.setScissor(left, 0, width, size.y);
        this.#renderer.render(this.#scene, this.#camera);
      }
      this.#renderer.setScissorTest(false);
      return;
    }
    this.#renderer.render(this.#scene, this.#camera);
  };

  #pointerDown = (event: PointerEvent): void => {
    this.#down.set(event.clientX, event.clientY);
  };

  #pointerUp = (event: PointerEvent): void => {
    const moved = this.#down.distanceTo(new Vector2(event.clientX, event.clientY));
    if (moved > 4) return;
    const place = this.canvas.getBoundingClientRect();
    this.measureAt(
      ((event.clientX - place.left) / place.width) * 2 - 1,
      1 - ((event.clientY - place.top) / place.height) * 2,
    );
  };

  /** Takes the point of the draft seen at a place, -1 to 1 from left and from below. */
  measureAt(x: number, y: number): void {
    const draft = this.#main;
    if (!this.#measuring || !draft) return;
    const at = new Vector2(x, y);
    const ray = new Raycaster();
    ray.setFromCamera(at, this.#camera);
    const hit = ray.intersectObjects(draft.clay, false)[0];
    if (!hit) return;
    if (this.#measured.length === 2) this.#measured = [];
    this.#measured.push(hit.point);
    const [a, b] = this.#measured;
    this.#line.visible = Boolean(a && b);
    if (a && b) this.#line.geometry.setFromPoints([a, b]);
    this.#measuring(a && b ? a.distanceTo(b) : null, this.#measured.length);
    this.invalidate();
  }
}
