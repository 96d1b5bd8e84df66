// The page: asks the server again and again, and draws what has changed.

import "uplot/dist/uPlot.min.css";
import "./style.css";
import { type Listing, NoAnswer, type Run, askForEvaluation, askForMetrics, askForRuns } from "./api";
import { Curves } from "./curves";
import { byId, element, setItems, setText } from "./elements";
import { RunList } from "./list";
import { Series } from "./metrics";
import { TONES, type Tone, onSchemeChange } from "./palette";
import { Player } from "./player";
import { Selection } from "./selection";
import { type Judged, Verdicts } from "./verdicts";

/** How long until the next question: while a run trains, and else [ms]. */
const SOON_MS = 1000;
const LATER_MS = 3000;

/** What the page knows of a run that is shown. */
interface Known {
  series: Series;
  /** What the list said when the numbers were asked for last. */
  asked: string | null;
  evaluation: unknown;
  /** The verdict in the list when eval.json was asked for last. */
  judged: string | null;
  problems: { metrics: string | null; evaluation: string | null };
}

class Page {
  private selection = Selection.fromAddress(location.hash);
  private listing: Listing | null = null;
  private known = new Map<string, Known>();
  private list = new RunList(this.selection, () => this.selectionChanged());
  private curves = new Curves();
  private verdicts = new Verdicts();
  private player = new Player();
  private view = byId("view") as HTMLSelectElement;
  private isFirst = true;
  private timer = 0;
  /** Questions do not overtake each other; somebody may not want to wait for the next. */
  private isAsking = false;
  private isHurried = false;

  start(): void {
    this.view.addEventListener("change", () => {
      this.selection.view = this.view.value;
      this.selectionChanged();
    });
    document.addEventListener("visibilitychange", () => this.askNow());
    window.addEventListener("hashchange", () => this.addressChanged());
    onSchemeChange(() => {
      this.list.draw();
      this.curves.recolour();
      this.verdicts.recolour();
      this.player.recolour();
      this.draw();
    });
    this.askNow();
  }

  private askNow(): void {
    window.clearTimeout(this.timer);
    if (this.isAsking) this.isHurried = true;
    else if (!document.hidden) void this.ask();
  }

  private async ask(): Promise<void> {
    this.isAsking = true;
    this.isHurried = false;
    try {
      const listing = await askForRuns();
      this.listing = listing;
      this.dropMissing(listing);
      this.chooseFirst(listing);
      this.list.show(listing);
      await Promise.all(this.shownRuns().map((run) => this.refresh(run)));
      this.draw();
      this.connection(null);
    } catch (error) {
      this.connection(error instanceof NoAnswer ? "No answer from canter serve; trying again." : String(error));
    } finally {
      this.isAsking = false;
      const isTraining = this.listing?.runs.some((run) => run.state === "training");
      const pause = this.isHurried ? 0 : isTraining ? SOON_MS : LATER_MS;
      this.timer = window.setTimeout(() => this.askNow(), pause);
    }
  }

  /** A run that was removed cannot be taken out by hand: it is in no list. */
  private dropMissing(listing: Listing): void {
    const missing = this.selection.ids().filter((id) => !listing.runs.some((run) => run.id === id));
    if (missing.length === 0) return;
    for (const id of missing) {
      this.selection.remove(id);
      this.known.delete(id);
    }
    this.writeAddress();
  }

  /** Without a choice in the address the newest run is shown. */
  private chooseFirst(listing: Listing): void {
    const [newest] = listing.runs;
    if (!this.isFirst || !newest) return;
    this.isFirst = false;
    if (this.selection.ids().length === 0) {
      this.selection.add(newest.id);
      this.writeAddress();
    }
  }

  private connection(problem: string | null): void {
    const place = byId("connection");
    place.hidden = problem === null;
    setText(place, problem ?? "");
  }

  private shownRuns(): Run[] {
    return this.listing?.runs.filter((run) => this.selection.has(run.id)) ?? [];
  }

  private knownOf(id: string): Known {
    let known = this.known.get(id);
    if (!known) {
      known = { series: new Series(), asked: null, evaluation: undefined, judged: null, problems: { metrics: null, evaluation: null } };
      this.known.set(id, known);
    }
    return known;
  }

  /** Asks for what is new of a run. */
  private async refresh(run: Run): Promise<void> {
    const known = this.knownOf(run.id);
    const asked = JSON.stringify([run.state, run.envSteps]);
    if (run.state === "training" || known.asked !== asked) {
      known.problems.metrics = await complaint(() => refreshMetrics(run.id, known.series));
      known.asked = known.problems.metrics === null ? asked : null;
    }
    const judged = JSON.stringify(run.verdict);
    if (known.judged !== judged) {
      known.evaluation = undefined;
      known.problems.evaluation = await complaint(async () => {
        if (run.verdict) known.evaluation = await askForEvaluation(run.id);
      });
      known.judged = known.problems.evaluation === null ? judged : null;
    }
  }

  private draw(): void {
    const runs = this.inOrder();
    this.curves.draw(runs.map((run) => ({ id: run.id, tone: this.selection.tone(run.id), series: this.knownOf(run.id).series })));
    setText(byId("curves-empty"), runs.length === 0 ? "Choose runs in the list to see their curves." : "");
    const notes = runs.flatMap((run) => {
      const { series, problems } = this.knownOf(run.id);
      const broken = series.broken > 0 ? [`${run.id}: ${series.broken} lines of metrics.jsonl cannot be read`] : [];
      return problems.metrics === null ? broken : [`${run.id}: ${problems.metrics}`];
    });
    setItems(byId("curve-notes"), notes);
    this.drawVerdicts(runs);
    this.drawView(runs);
  }

  private drawVerdicts(runs: readonly Run[]): void {
    const judged: Judged[] = [];
    const waiting: string[] = [];
    const failed: string[] = [];
    for (const run of runs) {
      const { evaluation, problems } = this.knownOf(run.id);
      if (problems.evaluation !== null) failed.push(`${run.id}: ${problems.evaluation}`);
      else if (evaluation === undefined) waiting.push(run.id);
      else judged.push({ id: run.id, tone: this.selection.tone(run.id), evaluation });
    }
    this.verdicts.draw(judged, waiting, failed);
  }

  private drawView(runs: readonly Run[]): void {
    // While a run is judged, its episodes come one by one.
    const recorded = runs.filter((run) => run.trajectories.length > 0 && run.verdict !== null);
    const viewed = recorded.find((run) => run.id === this.selection.view) ?? recorded[0] ?? null;
    const offered = [...this.view.options].map((option) => option.value);
    if (offered.join("\n") !== recorded.map((run) => run.id).join("\n")) {
      this.view.replaceChildren(...recorded.map((run) => element("option", { value: run.id }, run.id)));
    }
    if (viewed) this.view.value = viewed.id;
    setText(byId("player-empty"), viewed ? "" : "Choose a finished run: episodes are recorded with the verdict.");
    this.player.show(viewed, viewed ? this.selection.tone(viewed.id) : (TONES[0] as Tone));
  }

  /** The runs that are shown, in the order in which they were chosen. */
  private inOrder(): Run[] {
    const runs = this.shownRuns();
    return this.selection.ids().flatMap((id) => runs.find((run) => run.id === id) ?? []);
  }

  private selectionChanged(): void {
    for (const id of this.known.keys()) if (!this.selection.has(id)) this.known.delete(id);
    this.writeAddress();
    this.list.draw();
    this.draw();
    this.askNow();
  }

  private writeAddress(): void {
    history.replaceState(null, "", this.selection.toAddress());
  }

  /** Somebody has typed or followed another address of this page. */
  private addressChanged(): void {
    const wanted = Selection.fromAddress(location.hash);
    for (const id of this.selection.ids()) if (!wanted.has(id)) this.selection.remove(id);
    for (const id of wanted.ids()) this.selection.add(id);
    this.selection.view = wanted.view;
    this.selectionChanged();
  }
}

/** Asks until all is there. */
async function refreshMetrics(run: string, series: Series): Promise<void> {
  let restarts = 0;
  for (;;) {
    const answer = await askForMetrics(run, series.next);
    if (!series.take(answer)) {
      // Once a file was written anew, once more it is no file of a training.
      if (++restarts > 1) throw new Error("metrics.jsonl does not go on where it ended");
    } else if (!answer.more) {
      return;
    }
  }
}

/** What is wrong, in words; a lost connection is not the run's fault. */
async function complaint(act: () => Promise<void>): Promise<string | null> {
  try {
    await act();
    return null;
  } catch (error) {
    if (error instanceof NoAnswer) throw error;
    return error instanceof Error ? error.message : String(error);
  }
}

new Page().start();
