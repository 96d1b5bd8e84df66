// Curves over env steps: a chart for each number, a line for each run that is shown.

import uPlot from "uplot";
import { byId, element, setChildren, setText } from "./elements";
import type { Series } from "./metrics";
import { type Tone, colour } from "./palette";
import { count, short } from "./words";

/** A run as the charts see it. */
export interface Shown {
  id: string;
  tone: Tone;
  series: Series;
}

/** Charts that are always there; one more can be chosen. */
const CHARTS: readonly { metric: string; title: string; unit: string }[] = [
  { metric: "speed_m_per_s", title: "Speed while exploring", unit: "m/s" },
  { metric: "episode_return", title: "Episode return", unit: "" },
  { metric: "accidents", title: "Accidents in an iteration", unit: "episodes" },
  { metric: "power_w", title: "Mechanical power", unit: "W" },
];

/** What the chart of one's own shows first. */
const FIRST_CHOICE = "approx_kl";

const CHART_HEIGHT_PX = 190;

/** Lines of a chart move their cursors together. */
const SYNC = "env-steps";

export class Curves {
  private charts: Chart[];
  private chosen: Chart;
  private choice: HTMLSelectElement;
  private shown: readonly Shown[] = [];

  constructor() {
    const place = byId("charts");
    this.charts = CHARTS.map(({ metric, title, unit }) => new Chart(metric, element("h3", {}, unit ? `${title} [${unit}]` : title)));
    this.choice = element("select", { "aria-label": "Another number of metrics.jsonl", onchange: () => this.choose() });
    this.choice.append(element("option", {}, FIRST_CHOICE));
    this.chosen = new Chart(FIRST_CHOICE, element("h3", {}, this.choice));
    this.charts.push(this.chosen);
    place.append(...this.charts.map((chart) => chart.figure));
  }

  /** Draws what there is now. */
  draw(shown: readonly Shown[]): void {
    this.shown = shown;
    const names = new Set(shown.flatMap(({ series }) => [...series.columns.keys()]));
    for (const { metric } of CHARTS) names.delete(metric);
    names.add(this.choice.value || FIRST_CHOICE);
    this.offer([...names].sort());
    for (const chart of this.charts) chart.draw(shown);
  }

  /** Draws anew in the scheme's colours. */
  recolour(): void {
    for (const chart of this.charts) chart.forget();
    this.draw(this.shown);
  }

  private choose(): void {
    this.chosen.metric = this.choice.value;
    this.chosen.forget();
    this.draw(this.shown);
  }

  private offer(names: string[]): void {
    const offered = [...this.choice.options].map((option) => option.value);
    if (offered.join("\n") === names.join("\n")) return;
    const chosen = this.choice.value || FIRST_CHOICE;
    this.choice.replaceChildren(...names.map((name) => element("option", { value: name, selected: name === chosen }, name)));
  }
}

class Chart {
  readonly figure: HTMLElement;
  private place = element("div", { class: "plot" });
  private readout = element("p", { class: "readout" });
  private plot: uPlot | null = null;
  /** Which runs the plot has lines for, in order, and how far each of them is. */
  private lines = "";
  private drawn = "";
  private shown: readonly Shown[] = [];

  constructor(
    public metric: string,
    heading: HTMLElement,
  ) {
    this.figure = element("figure", { class: "chart" }, heading, this.place, this.readout);
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(this.place);
  }

  forget(): void {
    this.plot?.destroy();
    this.plot = null;
    this.drawn = "";
  }

  draw(shown: readonly Shown[]): void {
    const drawn = JSON.stringify([this.metric, shown.map(({ id, tone, series }) => [id, tone.light, series.version])]);
    if (drawn === this.drawn) return;
    this.shown = shown.filter(({ series }) => series.columns.has(this.metric));
    const columns = this.shown.map(({ series }) => series.columns.get(this.metric) ?? []);
    const points = columns.reduce((sum, column) => sum + numPoints(column), 0);
    this.figure.dataset.metric = this.metric;
    this.figure.dataset.points = String(points);
    const lines = this.shown.map(({ id, tone }) => `${tone.light} ${id}`).join("\n");
    if (lines !== this.lines || points === 0) this.forget();
    this.lines = lines;
    this.drawn = drawn;
    if (points === 0) {
      setText(this.readout, shown.length === 0 ? "" : "no number yet");
      return;
    }
    const tables: uPlot.AlignedData[] = this.shown.map(({ series }, run) => [series.envSteps, columns[run] ?? []]);
    const data = tables.length === 1 ? (tables[0] as uPlot.AlignedData) : uPlot.join(tables);
    if (this.plot) renew(this.plot, data);
    else this.plot = new uPlot(this.options(), data, this.place);
    this.read();
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(160, this.place.clientWidth), height: CHART_HEIGHT_PX };
  }

  private options(): uPlot.Options {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--mut").trim();
    const line = style.getPropertyValue("--line").trim();
    const axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1, size: 4 }, font: "11px system-ui" };
    return {
      ...this.size(),
      legend: { show: false },
      cursor: { sync: { key: SYNC }, drag: { x: true, y: false }, points: { size: 6 } },
      scales: { x: { time: false } },
      axes: [
        { ...axis, size: 28, values: (_, ticks) => ticks.map(stepsLabel) },
        { ...axis, size: 52 },
      ],
      series: [
        {},
        ...this.shown.map(({ id, tone }) => ({
          label: id,
          stroke: colour(tone),
          dash: tone.dash,
          width: 1.6,
          spanGaps: true,
          // A single point is no line.
          points: { show: (plot: uPlot, line: number) => numPoints(plot.data[line] ?? []) === 1 },
        })),
      ],
      hooks: { setCursor: [() => this.read()] },
    };
  }

  /** The numbers at the cursor, or the last ones. */
  private read(): void {
    const plot = this.plot;
    if (!plot) return;
    const steps = plot.data[0];
    const cursor = plot.cursor.idx ?? null;
    const position = cursor ?? steps.length - 1;
    const words = this.shown.map((run, line) => {
      const value = lastUpTo(plot.data[line + 1] ?? [], position);
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = colour(run.tone);
      return element("span", { class: "reading", title: run.id }, swatch, short(value));
    });
    const when = cursor === null ? "last" : `at ${count(steps[position] ?? null)}`;
    setChildren(this.readout, [element("span", { class: "when" }, when), ...words]);
  }
}

/** Gives a plot newer numbers; where the person has zoomed in, it stays there. */
function renew(plot: uPlot, data: uPlot.AlignedData): void {
  const { min, max } = plot.scales.x ?? {};
  const steps = plot.data[0];
  const isWhole = min === steps[0] && max === steps[steps.length - 1];
  plot.setData(data, isWhole);
  if (!isWhole && min != null && max != null) plot.setScale("x", { min, max });
}

function numPoints(values: ArrayLike<number | null | undefined>): number {
  let count = 0;
  for (let i = 0; i < values.length; i++) if (values[i] != null) count += 1;
  return count;
}

/** The newest number that is not missing at or before a position. */
function lastUpTo(values: ArrayLike<number | null | undefined>, position: number): number | null {
  for (let i = Math.min(position, values.length - 1); i >= 0; i--) {
    const value = values[i];
    if (value !== null && value !== undefined) return value;
  }
  return null;
}

/** 200k, 1.5M: env steps on an axis. */
function stepsLabel(steps: number): string {
  if (Math.abs(steps) >= 1e6) return `${Number((steps / 1e6).toPrecision(4))}M`;
  return Math.abs(steps) >= 1e3 ? `${Number((steps / 1e3).toPrecision(4))}k` : String(steps);
}
