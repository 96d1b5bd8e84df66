// The list of runs.

import { type Listing, type Run, reportAddress } from "./api";
import { byId, element, setChildren, setItems, setText } from "./elements";
import { colour } from "./palette";
import type { Selection } from "./selection";
import { age, count, fixed, percent } from "./words";

/** More notes are not read. */
const MAX_NOTES = 20;

export class RunList {
  private rows = new Map<string, Row>();
  private body = byId("runs");
  private filter = byId("filter") as HTMLInputElement;
  private listing: Listing | null = null;
  private drawnReports = "";

  constructor(
    private selection: Selection,
    private onChange: () => void,
  ) {
    this.filter.addEventListener("input", () => this.draw());
  }

  show(listing: Listing): void {
    this.listing = listing;
    this.draw();
  }

  draw(): void {
    const listing = this.listing;
    if (!listing) return;
    // Runs that train keep their places: each of them is the newest every second.
    const training = listing.runs.filter((run) => run.state === "training").sort((a, b) => (a.id < b.id ? -1 : 1));
    const others = listing.runs.filter((run) => run.state !== "training");
    const wanted = this.filter.value.trim().toLowerCase();
    const matches = (run: Run) => `${run.id} ${run.robot ?? ""} ${run.state}`.toLowerCase().includes(wanted);
    const runs = [...training, ...others].filter((run) => wanted === "" || matches(run) || this.selection.has(run.id));
    const rows = runs.map((run) => {
      const row = this.rows.get(run.id) ?? new Row(run.id, () => this.toggle(run.id));
      this.rows.set(run.id, row);
      row.draw(run, this.selection);
      return row.element;
    });
    setChildren(this.body, rows);
    const listed = new Set(runs.map((run) => run.id));
    this.rows = new Map([...this.rows].filter(([id]) => listed.has(id)));

    const empty = byId("empty");
    empty.hidden = listing.runs.length > 0;
    byId("run-table").hidden = listing.runs.length === 0;
    setText(byId("hint"), listing.hint);
    setText(byId("folder"), listing.folder);
    setText(byId("numbers"), describe(listing, runs.length));
    const notes = [...listing.leftOut, ...runs.flatMap((run) => run.problems.map((problem) => `${run.id}: ${problem}`))];
    setItems(byId("list-notes"), notes.slice(0, MAX_NOTES));
    this.drawReports(listing);
  }

  private drawReports({ reports }: Listing): void {
    const drawn = JSON.stringify(reports);
    if (drawn === this.drawnReports) return;
    this.drawnReports = drawn;
    byId("reports").replaceChildren(...reports.map(({ id, kind }) => element("li", {}, reportLink(id, `${id} (${kind})`))));
    byId("reports-part").hidden = reports.length === 0;
  }

  private toggle(id: string): void {
    if (this.selection.has(id)) {
      this.selection.remove(id);
    } else if (this.selection.isFull()) {
      setText(byId("refusal"), "Eight runs are shown, which is the most; take one out first.");
      this.draw();
      return;
    } else {
      this.selection.add(id);
    }
    setText(byId("refusal"), "");
    this.onChange();
  }
}

/** A run in the table. */
class Row {
  readonly element: HTMLTableRowElement;
  private box: HTMLInputElement;
  private swatch = element("span", { class: "swatch" });
  private name: HTMLElement;
  private state = element("span", { class: "state" });
  private bar = element("progress", { max: 1, "aria-label": "env steps done" });
  private about = element("small", { class: "about" });
  private cells = {
    steps: element("td", { class: "n wide" }),
    speed: element("td", { class: "n" }),
    ratio: element("td", { class: "n" }),
    age: element("td", { class: "n wide" }),
    report: element("td", {}),
  };

  constructor(id: string, toggle: () => void) {
    this.box = element("input", { type: "checkbox", onchange: toggle });
    this.name = element("span", { class: "name" }, id);
    const { steps, speed, ratio, age, report } = this.cells;
    this.element = element(
      "tr",
      {},
      element("th", { scope: "row" }, element("label", {}, this.box, this.swatch, element("span", {}, this.name, this.about))),
      element("td", { class: "progress" }, this.state, this.bar),
      steps,
      speed,
      ratio,
      age,
      report,
    );
    this.element.dataset.run = id;
  }

  draw(run: Run, selection: Selection): void {
    const isShown = selection.has(run.id);
    this.element.dataset.state = run.state;
    this.element.classList.toggle("shown", isShown);
    this.box.checked = isShown;
    this.swatch.style.background = isShown ? colour(selection.tone(run.id)) : "transparent";
    const done = run.envSteps !== null && run.maxEnvSteps ? Math.min(1, run.envSteps / run.maxEnvSteps) : null;
    const isTraining = run.state === "training";
    // A whole training is followed by its evaluation.
    const doing = done === 1 ? "judging" : "training";
    setText(this.state, isTraining ? `${doing}${done === null || done === 1 ? "" : ` ${percent(done)}`}` : run.state);
    this.bar.hidden = !isTraining;
    this.bar.value = done ?? 0;
    setText(this.about, [run.robot ?? [], run.seed === null ? [] : `seed ${run.seed}`].flat().join(", "));
    setText(this.cells.steps, count(run.envSteps));
    const { verdict } = run;
    setText(this.cells.speed, fixed(verdict ? verdict.speed : run.speed, 2));
    this.cells.speed.title = verdict
      ? `of the learned gait, judged: ${fixed(verdict.falls, 0)} falls in ${fixed(verdict.numEpisodes, 0)} episodes`
      : "of the last iteration, exploring";
    setText(this.cells.ratio, verdict && verdict.ratio !== null ? `${fixed(verdict.ratio, 2)}\u00d7` : "\u2013");
    this.cells.ratio.title = ratioTitle(run);
    setText(this.cells.age, age(run.updatedS));
    if (run.hasReport && this.cells.report.childElementCount === 0) this.cells.report.append(reportLink(run.id, "report"));
    if (!run.hasReport) this.cells.report.replaceChildren();
  }
}

function ratioTitle({ verdict }: Run): string {
  if (!verdict) return "no verdict yet";
  const [low, high] = verdict.ratioInterval ?? [null, null];
  return `times the default gait ${verdict.defaultGait ?? ""}, 95 % interval ${fixed(low, 2)} to ${fixed(high, 2)}`;
}

function reportLink(id: string, words: string): HTMLElement {
  return element("a", { href: reportAddress(id), target: "_blank", rel: "noopener" }, words);
}

function describe(listing: Listing, numShown: number): string {
  const numTraining = listing.runs.filter((run) => run.state === "training").length;
  const runs = `${listing.runs.length} ${listing.runs.length === 1 ? "run" : "runs"}`;
  const filtered = numShown < listing.runs.length ? `, ${numShown} listed` : "";
  return `${runs}${filtered}${numTraining > 0 ? `, ${numTraining} training` : ""}`;
}
