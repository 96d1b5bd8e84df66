// Robots in 3D, drawn from recorded episodes: a box between the hips, a rod for every link, a ball for every joint.

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  CylinderGeometry,
  DirectionalLight,
  DynamicDrawUsage,
  Group,
  HemisphereLight,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  type Object3D,
  PerspectiveCamera,
  PlaneGeometry,
  Quaternion,
  Scene,
  SphereGeometry,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { type Episode, bodyHalfSize, stepAt } from "./trajectory";

/** How robots stand to each other: each on its own track that moves below it, or all on one ground, where they walk away. */
export type Layout = "tracks" | "ground";

/** A gait that is drawn. */
export interface Walker {
  episode: Episode;
  colour: string;
}

/** The colours of the page. */
export interface Colours {
  background: string;
  ground: string;
  line: string;
  strongLine: string;
  link: string;
  touching: string;
}

/** Distances of the ground's lines; every fourth is strong [m]. */
const LINE_DISTANCE_M = 0.25;
const STRONG_EVERY = 4;

/** Rods and balls in leg lengths. */
const ROD_RADIUS = 0.05;
const JOINT_RADIUS = 0.075;
const FOOT_RADIUS = 0.11;
const BODY_MARGIN = 0.22;
const BODY_THICKNESS = 0.34;

/** How far a track reaches to the front and to the back, in leg lengths. */
const TRACK_REACH = 7;

/** Forward is right in the picture, the camera a little behind and above [of its distance]. */
const VIEW = new Vector3(0.28, -0.86, 0.42);

const UP = new Vector3(0, 1, 0);

export class Stage {
  private renderer: WebGLRenderer;
  private scene = new Scene();
  /** Everything that stands on the ground, tilted with it. */
  private tilted = new Group();
  private camera = new PerspectiveCamera(32, 1, 0.01, 500);
  private controls: OrbitControls;
  private robots: Robot[] = [];
  private grounds: Ground[] = [];
  private layout: Layout = "tracks";
  private colours: Colours;
  /** What the camera looks at, in the ground's frame. */
  private focus = new Vector3();
  private timeS = 0;

  /** Throws where the browser has no WebGL. `onMove` is called when the person has moved the camera. */
  constructor(canvas: HTMLCanvasElement, colours: Colours, onMove: () => void) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.colours = colours;
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    // Arrow keys move the camera, with Shift they turn it. The wheel belongs to the page until somebody has clicked here.
    this.controls.listenToKeyEvents(canvas);
    this.controls.enableZoom = false;
    canvas.addEventListener("focus", () => (this.controls.enableZoom = true));
    canvas.addEventListener("blur", () => (this.controls.enableZoom = false));
    this.controls.addEventListener("change", onMove);
    const sun = new DirectionalLight(0xffffff, 1.9);
    sun.position.set(-2, -3, 5);
    this.scene.add(this.tilted, new HemisphereLight(0xffffff, 0x8a8f98, 1.9), sun);
  }

  /** Puts these robots on the stage, the first one nearest to the camera. */
  show(walkers: readonly Walker[], layout: Layout): void {
    this.layout = layout;
    this.clear();
    this.scene.background = new Color(this.colours.background);
    const first = walkers[0];
    if (!first) return;
    this.tilted.rotation.y = (-first.episode.slopeDeg * Math.PI) / 180;
    this.robots = walkers.map((walker) => new Robot(walker, this.colours));
    const numGrounds = layout === "tracks" ? walkers.length : 1;
    this.grounds = Array.from({ length: numGrounds }, () => new Ground(this.colours));
    this.setLanes();
    this.tilted.add(...[...this.robots, ...this.grounds].map((part) => part.object));
    this.place();
  }

  recolour(colours: Colours): void {
    this.colours = colours;
  }

  setTime(timeS: number): void {
    this.timeS = timeS;
    this.place();
  }

  resize(width: number, height: number): void {
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  draw(): void {
    this.renderer.render(this.scene, this.camera);
  }

  /** Moves the camera back to where it began. */
  lookAtAll(): void {
    const sizes = this.robots.map((robot) => robot.reach);
    const across = this.layout === "tracks" ? (this.robots.at(-1)?.lane ?? 0) + 2 * Math.max(...sizes, 0.1) : 0;
    const along = Math.max(...this.robots.map((robot) => 2 * TRACK_REACH * 0.55 * robot.legLength), 0.1);
    const distance = 1.75 * Math.max(along, 0.8 * across) * Math.max(1, 1.25 / this.camera.aspect);
    this.controls.target.copy(this.focus).applyEuler(this.tilted.rotation);
    this.camera.position.copy(VIEW).setLength(distance).add(this.controls.target);
    this.controls.minDistance = 0.2 * distance;
    this.controls.maxDistance = 20 * distance;
    this.controls.update();
  }

  /** Frees what the graphics card holds for the robots that are shown. */
  private clear(): void {
    for (const part of [...this.robots, ...this.grounds]) {
      this.tilted.remove(part.object);
      free(part.object);
    }
    this.robots = [];
    this.grounds = [];
  }

  /** Beside each other so that no two touch: at any time where they walk on one ground. */
  private setLanes(): void {
    let before: Robot | null = null;
    for (const robot of this.robots) {
      if (before) {
        const gap = 1.15 * (before.reach + robot.reach);
        robot.lane = before.lane + gap + (this.layout === "ground" ? before.mostLeftOf(robot) : 0);
      }
      before = robot;
    }
  }

  /** Everything at the time that is shown. */
  private place(): void {
    const focus = new Vector3();
    for (const [number, robot] of this.robots.entries()) {
      const body = robot.pose(this.timeS);
      const ground = this.grounds[number];
      if (this.layout === "tracks") {
        robot.object.position.set(-body.x, robot.lane - body.y, 0);
        const reach = TRACK_REACH * robot.legLength;
        ground?.lay(body, new Vector3(0, robot.lane, 0), reach, 1.02 * robot.reach);
        focus.y += robot.lane / this.robots.length;
      } else {
        robot.object.position.set(0, robot.lane, 0);
        focus.add(new Vector3(body.x, body.y + robot.lane, 0).divideScalar(this.robots.length));
      }
      focus.z = 0.5 * robot.legLength;
    }
    if (this.layout === "ground") this.layOneGround(focus);
    // The camera goes with the robots and keeps its angle.
    const moved = focus.clone().sub(this.focus).applyEuler(this.tilted.rotation);
    this.focus = focus;
    this.camera.position.add(moved);
    this.controls.target.add(moved);
    this.controls.update();
  }

  private layOneGround(focus: Vector3): void {
    const spread = (axis: "x" | "y") =>
      Math.max(...this.robots.map((robot) => Math.abs(robot.body[axis] + (axis === "y" ? robot.lane : 0) - focus[axis])), 0);
    const [legLength, reach] = [this.robots[0]?.legLength ?? 1, this.robots[0]?.reach ?? 1];
    const at = new Vector3(focus.x, focus.y, 0);
    this.grounds[0]?.lay(at, at, spread("x") + TRACK_REACH * legLength, spread("y") + 2 * reach);
  }
}

/** A robot's parts in the ground's frame. */
class Robot {
  readonly object = new Group();
  readonly legLength: number;
  /** Half of its diagonal seen from above: how close others may come [m]. */
  readonly reach: number;
  /** How far it stands to the left [m]. */
  lane = 0;
  /** Where its body is now. */
  readonly body = new Vector3();
  private episode: Episode;
  private box: Mesh;
  private rods: InstancedMesh;
  private joints: InstancedMesh;
  private feet: InstancedMesh;
  private touching: Color;
  private free: Color;

  constructor({ episode, colour }: Walker, colours: Colours) {
    this.episode = episode;
    this.legLength = episode.legLength;
    const margin = BODY_MARGIN * episode.legLength;
    const [halfLength, halfWidth] = bodyHalfSize(episode).map((half) => half + margin) as [number, number];
    this.reach = Math.hypot(halfLength, halfWidth);
    this.touching = new Color(colours.touching);
    this.free = new Color(colours.link);
    const shape = new BoxGeometry(2 * halfLength, 1.4 * halfWidth, BODY_THICKNESS * episode.legLength);
    this.box = new Mesh(shape, new MeshLambertMaterial({ color: colour }));
    const link = new MeshLambertMaterial({ color: colours.link });
    const joint = new MeshLambertMaterial({ color: colour });
    const ball = (radius: number) => new SphereGeometry(radius * episode.legLength, 16, 12);
    const radius = ROD_RADIUS * episode.legLength;
    this.rods = instanced(new CylinderGeometry(radius, radius, 1, 12), link, 4 * episode.numLegs);
    this.joints = instanced(ball(JOINT_RADIUS), joint, 3 * episode.numLegs);
    // White, so that each foot's own colour is what is seen.
    this.feet = instanced(ball(FOOT_RADIUS), new MeshLambertMaterial({ color: 0xffffff }), episode.numLegs);
    this.object.add(this.box, this.rods, this.joints, this.feet);
  }

  /** Takes the pose at a time and says where the body is. */
  pose(timeS: number): Vector3 {
    const { episode } = this;
    const step = stepAt(episode, timeS);
    this.body.fromArray(episode.position, 3 * step);
    const [roll = 0, pitch = 0, yaw = 0] = episode.orientation.subarray(3 * step, 3 * step + 3);
    this.box.position.copy(this.body);
    this.box.rotation.set(roll, pitch, yaw, "ZYX");
    const [hip, knee, foot] = [new Vector3(), new Vector3(), new Vector3()];
    const matrix = new Matrix4();
    for (let leg = 0; leg < episode.numLegs; leg++) {
      const row = step * episode.numLegs + leg;
      hip.fromArray(episode.hip, 3 * row);
      foot.fromArray(episode.foot, 3 * row);
      this.joints.setMatrixAt(3 * leg, matrix.makeTranslation(hip));
      for (const motor of [0, 1]) {
        knee.fromArray(episode.knee, 3 * (2 * row + motor));
        this.joints.setMatrixAt(3 * leg + 1 + motor, matrix.makeTranslation(knee));
        this.rods.setMatrixAt(4 * leg + 2 * motor, rod(hip, knee, matrix));
        this.rods.setMatrixAt(4 * leg + 2 * motor + 1, rod(knee, foot, matrix));
      }
      this.feet.setMatrixAt(leg, matrix.makeTranslation(foot));
      this.feet.setColorAt(leg, episode.contact[row] ? this.touching : this.free);
    }
    for (const mesh of [this.rods, this.joints, this.feet]) mesh.instanceMatrix.needsUpdate = true;
    if (this.feet.instanceColor) this.feet.instanceColor.needsUpdate = true;
    return this.body;
  }

  /** How far to the left of another robot this one comes, at the same time [m]. */
  mostLeftOf(other: Robot): number {
    const steps = Math.max(this.episode.numSteps, other.episode.numSteps);
    let most = 0;
    for (let step = 0; step < steps; step++) {
      const left = (episode: Episode) => episode.position[3 * Math.min(step, episode.numSteps - 1) + 1] ?? 0;
      most = Math.max(most, left(this.episode) - left(other.episode));
    }
    return most;
  }
}

/** A piece of ground with lines that stay where they are while the piece moves over it. */
class Ground {
  readonly object = new Group();
  private plane: Mesh;
  private thin: Lines;
  private strong: Lines;

  constructor(colours: Colours) {
    const material = new MeshBasicMaterial({ color: colours.ground, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    this.plane = new Mesh(new PlaneGeometry(1, 1), material);
    this.thin = new Lines(colours.line);
    this.strong = new Lines(colours.strongLine);
    this.object.add(this.plane, this.thin.object, this.strong.object);
  }

  /** Shows the ground around `centre`, moved to `place`. */
  lay(centre: Vector3, place: Vector3, halfLength: number, halfWidth: number): void {
    this.plane.position.copy(place);
    this.plane.scale.set(2 * halfLength, 2 * halfWidth, 1);
    const [thin, strong]: [number[], number[]] = [[], []];
    for (const [at, isStrong] of lineNumbers(centre.x, halfLength)) {
      (isStrong ? strong : thin).push(at + place.x, place.y - halfWidth, 0, at + place.x, place.y + halfWidth, 0);
    }
    for (const [at, isStrong] of lineNumbers(centre.y, halfWidth)) {
      (isStrong ? strong : thin).push(place.x - halfLength, at + place.y, 0, place.x + halfLength, at + place.y, 0);
    }
    this.thin.set(thin);
    this.strong.set(strong);
  }
}

/** Lines around a place within half a length: how far from it, and whether it is a strong one. */
function* lineNumbers(centre: number, half: number): Generator<[number, boolean]> {
  // Where the ground is very large, fewer lines.
  const distance = LINE_DISTANCE_M * STRONG_EVERY ** Math.max(0, Math.ceil(Math.log(half / 20) / Math.log(STRONG_EVERY)));
  for (let n = Math.ceil((centre - half) / distance); n * distance <= centre + half; n++) {
    yield [n * distance - centre, n % STRONG_EVERY === 0];
  }
}

/** Segments whose number changes. */
class Lines {
  readonly object: LineSegments;

  constructor(colour: string) {
    this.object = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: colour }));
    this.object.frustumCulled = false;
  }

  set(points: number[]): void {
    const { geometry } = this.object;
    const old = geometry.getAttribute("position") as BufferAttribute | undefined;
    if (!old || old.array.length < points.length) {
      // A buffer on the graphics card cannot grow.
      geometry.dispose();
      this.object.geometry = new BufferGeometry();
      const grown = new BufferAttribute(new Float32Array(2 * points.length), 3);
      this.object.geometry.setAttribute("position", grown.setUsage(DynamicDrawUsage));
    }
    const position = this.object.geometry.getAttribute("position") as BufferAttribute;
    position.array.set(points);
    position.needsUpdate = true;
    this.object.geometry.setDrawRange(0, points.length / 3);
  }
}

function instanced(geometry: BufferGeometry, material: MeshLambertMaterial, count: number): InstancedMesh {
  const mesh = new InstancedMesh(geometry, material, count);
  mesh.frustumCulled = false;
  return mesh;
}

/** The matrix that makes a rod of length 1 one between two points. */
function rod(from: Vector3, to: Vector3, matrix: Matrix4): Matrix4 {
  const along = to.clone().sub(from);
  const length = Math.max(along.length(), 1e-6);
  const turned = new Quaternion().setFromUnitVectors(UP, along.divideScalar(length));
  return matrix.compose(from.clone().add(to).multiplyScalar(0.5), turned, new Vector3(1, length, 1));
}

function free(object: Object3D): void {
  object.traverse((part) => {
    if (part instanceof Mesh || part instanceof LineSegments) {
      part.geometry.dispose();
      part.material.dispose();
    }
    if (part instanceof InstancedMesh) part.dispose();
  });
}
