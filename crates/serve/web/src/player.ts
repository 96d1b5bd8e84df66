// The robot of one run in 3D, with its controls: which gaits, the clock, how the robots stand to each other.

import { askForTrajectory, type Run } from "./api";
import { byId, element, setText } from "./elements";
import { DEFAULT_TONES, type Tone, colour } from "./palette";
import { type Colours, type Layout, Stage } from "./scene";
import { type Episode, durationS, readEpisode, speedSoFar } from "./trajectory";
import { fixed } from "./words";

/** Gaits that stand beside each other at most. */
const MAX_GAITS = 8;

const LEARNED = "learned";

/** A page that was hidden does not leap ahead [ms]. */
const LONGEST_FRAME_MS = 100;

/** A recorded gait of the run that is shown. */
interface Gait {
  name: string;
  tone: Tone;
  isShown: boolean;
  episode: Episode | null;
  /** What is wrong with its file. */
  problem: string | null;
  label: HTMLElement;
}

export class Player {
  private canvas = byId("canvas") as HTMLCanvasElement;
  private play = byId("play") as HTMLButtonElement;
  private scrubber = byId("scrubber") as HTMLInputElement;
  private pace = byId("pace") as HTMLSelectElement;
  private layout = byId("layout") as HTMLSelectElement;
  private stage: Stage | null = null;
  private gaits: Gait[] = [];
  /** Which run and files are shown; other files come with another number of the question. */
  private shown = "";
  private question = 0;
  private timeS = 0;
  private isPlaying = false;
  private isVisible = true;
  /** The picture that was asked for; 0 if none was. */
  private frame = 0;
  /** Of the last picture [ms]; null while nothing moves. */
  private before: number | null = null;

  constructor() {
    try {
      this.stage = new Stage(this.canvas, readColours(), () => this.wake());
    } catch {
      // Said where the robot would stand.
      byId("stage").hidden = true;
      setText(byId("player-note"), "This browser has no WebGL, so there is no robot in 3D; the run's report draws it from the side.");
    }
    this.play.addEventListener("click", () => this.setPlaying(!this.isPlaying));
    this.scrubber.addEventListener("input", () => {
      this.setPlaying(false);
      this.setTime(Number(this.scrubber.value));
    });
    this.layout.addEventListener("change", () => {
      this.build();
      this.stage?.lookAtAll();
    });
    byId("recentre").addEventListener("click", () => {
      this.stage?.lookAtAll();
      this.wake();
    });
    // The graphics card may take its memory away and give it back.
    this.canvas.addEventListener("webglcontextrestored", () => this.wake());
    new ResizeObserver(() => this.resize()).observe(byId("stage"));
    new IntersectionObserver(([entry]) => {
      this.isVisible = entry?.isIntersecting ?? true;
      this.wake();
    }).observe(this.canvas);
  }

  /** Shows a run's robot; null for none. `tone` is the run's. */
  show(run: Run | null, tone: Tone): void {
    if (!this.stage) return;
    const key = run ? JSON.stringify([run.id, run.trajectories, run.verdict, tone.light]) : "";
    if (key === this.shown) return;
    this.shown = key;
    byId("player").hidden = !run;
    if (!run) {
      this.gaits = [];
      this.build();
      return;
    }
    const names = run.trajectories.slice(0, MAX_GAITS);
    // The fastest default gait is what the learned one is held against.
    const rival = names.find((name) => name === run.verdict?.defaultGait) ?? names.find((name) => name !== LEARNED);
    let numDefaults = 0;
    this.gaits = names.map((name) => ({
      name,
      tone: name === LEARNED ? tone : (DEFAULT_TONES[numDefaults++ % DEFAULT_TONES.length] as Tone),
      isShown: name === LEARNED || name === rival,
      episode: null,
      problem: null,
      label: element("span", { class: "speed-so-far" }),
    }));
    this.drawChoice();
    const question = ++this.question;
    void this.load(run.id, question);
  }

  /** Draws anew in the scheme's colours. */
  recolour(): void {
    this.stage?.recolour(readColours());
    this.drawChoice();
    this.build();
  }

  private async load(run: string, question: number): Promise<void> {
    await Promise.all(
      this.gaits.map(async (gait) => {
        try {
          gait.episode = readEpisode(await askForTrajectory(run, gait.name));
        } catch (error) {
          gait.problem = error instanceof Error ? error.message : String(error);
        }
      }),
    );
    if (question !== this.question) return;
    this.timeS = 0;
    this.drawChoice();
    this.build();
    this.stage?.lookAtAll();
    this.setPlaying(this.isAny() && !window.matchMedia("(prefers-reduced-motion: reduce)").matches);
  }

  private isAny(): boolean {
    return this.gaits.some((gait) => gait.isShown && gait.episode);
  }

  /** Checkboxes for the gaits, with what is wrong with them. */
  private drawChoice(): void {
    const choices = this.gaits.map((gait) => {
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = colour(gait.tone);
      const box = element("input", {
        type: "checkbox",
        checked: gait.isShown,
        disabled: gait.problem !== null,
        onchange: () => {
          gait.isShown = box.checked;
          this.build();
        },
      });
      const { episode } = gait;
      const name = gait.name === LEARNED ? "learned" : `${gait.name} (default)`;
      const parts = [box, swatch, name, " ", gait.label];
      if (episode?.accident) parts.push(` ends with an accident: ${episode.accident}`);
      if (episode?.isUneven) parts.push(" on uneven ground, drawn as a plane");
      const label = element("label", {}, ...parts);
      return element("li", {}, label, gait.problem === null ? "" : `cannot be drawn: ${gait.problem}`);
    });
    byId("gaits").replaceChildren(...choices);
  }

  /** Puts the chosen gaits on the stage. */
  private build(): void {
    const walkers = this.gaits.flatMap(({ isShown, episode, tone }) => (isShown && episode ? [{ episode, colour: colour(tone) }] : []));
    this.stage?.show(walkers, this.layout.value as Layout);
    this.canvas.dataset.gaits = String(walkers.length);
    const longest = Math.max(0, ...walkers.map(({ episode }) => durationS(episode)));
    this.scrubber.max = String(longest);
    this.scrubber.step = String(Math.min(...walkers.map(({ episode }) => episode.dtS), 1));
    this.play.disabled = walkers.length === 0;
    this.resize();
    this.setTime(Math.min(this.timeS, longest));
  }

  private setPlaying(isPlaying: boolean): void {
    this.isPlaying = isPlaying && this.isAny();
    this.before = null;
    if (this.isPlaying && this.timeS >= Number(this.scrubber.max)) this.setTime(0);
    setText(this.play, this.isPlaying ? "Pause" : "Play");
    this.wake();
  }

  private setTime(timeS: number): void {
    this.timeS = timeS;
    this.stage?.setTime(timeS);
    this.canvas.dataset.time = timeS.toFixed(3);
    this.scrubber.value = String(timeS);
    setText(byId("clock"), `${fixed(timeS, 2)} s`);
    for (const { episode, label } of this.gaits) {
      const speed = episode ? speedSoFar(episode, timeS) : null;
      setText(label, speed === null ? "" : `${fixed(speed, 2)} m/s so far`);
    }
    this.wake();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = byId("stage");
    if (clientWidth === 0 || clientHeight === 0) return;
    this.stage?.resize(clientWidth, clientHeight);
    this.wake();
  }

  /** Asks for a picture; more follow while the clock runs and somebody can see it. */
  private wake(): void {
    if (this.frame === 0) this.frame = requestAnimationFrame((now) => this.picture(now));
  }

  private picture(now: number): void {
    this.frame = 0;
    if (!this.isVisible) {
      this.before = null;
      return;
    }
    if (this.isPlaying) {
      const passedMs = this.before === null ? 0 : Math.min(now - this.before, LONGEST_FRAME_MS);
      const timeS = this.timeS + (passedMs / 1000) * Number(this.pace.value);
      this.before = now;
      const end = Number(this.scrubber.max);
      this.setTime(Math.min(timeS, end));
      // A page that is left open draws nothing for nobody.
      if (timeS >= end) this.setPlaying(false);
    }
    this.stage?.draw();
  }
}

function readColours(): Colours {
  const style = getComputedStyle(document.documentElement);
  const read = (name: string) => style.getPropertyValue(name).trim();
  return {
    background: read("--stage"),
    ground: read("--stage-ground"),
    line: read("--stage-line"),
    strongLine: read("--stage-strong-line"),
    link: read("--stage-link"),
    touching: read("--stage-touching"),
  };
}
