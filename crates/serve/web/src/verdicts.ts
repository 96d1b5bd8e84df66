// Verdicts side by side, from eval.json.

import { byId, element, setItems, setText } from "./elements";
import { type Tone, colour } from "./palette";
import { at, entries, interval, number, text } from "./values";
import { fixed } from "./words";

/** A run with its eval.json. */
export interface Judged {
  id: string;
  tone: Tone;
  evaluation: unknown;
}

/** A measured gait: a row. */
interface Gait {
  name: string;
  tone: Tone | null;
  report: unknown;
  numEpisodes: number | null;
  /** Times the fastest default gait, where that is part of the file. */
  ratio: number | null;
  ratioInterval: [number, number] | null;
}

/** What was measured alike: a table. */
interface Group {
  protocol: Map<string, string>;
  gaits: Gait[];
}

const COLUMNS: readonly { title: string; unit: string; read: (gait: Gait) => string }[] = [
  { title: "speed", unit: "m/s, 95 % interval", read: ({ report }) => withInterval(number(at(report, "speed_m_per_s")), interval(at(report, "speed_ci")), 3) },
  { title: "ratio", unit: "to the default gait", read: ({ ratio, ratioInterval }) => withInterval(ratio, ratioInterval, 2) },
  { title: "falls", unit: "episodes", read: ({ report, numEpisodes }) => `${fixed(number(at(report, "falls")), 0)} of ${fixed(numEpisodes, 0)}` },
  { title: "drift", unit: "m", read: ({ report }) => fixed(number(at(report, "drift_m")), 2) },
  { title: "turn", unit: "deg", read: ({ report }) => fixed(number(at(report, "heading_deg")), 1) },
  { title: "bounce", unit: "mm", read: ({ report }) => fixed(times(number(at(report, "height_std_m")), 1e3), 1) },
  { title: "power", unit: "W", read: ({ report }) => fixed(number(at(report, "power_w")), 1) },
  { title: "cost of transport", unit: "", read: ({ report }) => fixed(number(at(report, "cost_of_transport")), 2) },
];

/** The tables. They are made anew only where something differs: somebody may be reading them. */
export class Verdicts {
  private drawn: readonly unknown[] = [];

  /** `waiting` runs have no verdict yet; `failed` are said in words. */
  draw(judged: readonly Judged[], waiting: readonly string[], failed: readonly string[]): void {
    const now = [...judged.flatMap(({ id, tone, evaluation }) => [id, tone, evaluation]), ...waiting, ...failed];
    if (now.length === this.drawn.length && now.every((part, position) => part === this.drawn[position])) return;
    this.drawn = now;
    const groups = groupsOf(judged);
    byId("verdict-tables").replaceChildren(...groups.map((group) => table(group, groups)));
    const notes = [...failed];
    if (waiting.length > 0) notes.push(`No verdict yet: ${waiting.join(", ")}.`);
    if (groups.length > 1) {
      const what = differences(groups).join(", ");
      notes.push(`These runs were not measured alike (${what}): do not compare numbers of different tables.`);
    }
    setItems(byId("verdict-notes"), notes);
    setText(byId("verdict-empty"), groups.length + notes.length === 0 ? "Choose runs in the list to see their verdicts." : "");
  }

  /** What is drawn next is drawn in the scheme's colours. */
  recolour(): void {
    this.drawn = [];
  }
}

/** Runs that were measured alike stand in one table, with the default gaits once. */
export function groupsOf(judged: readonly Judged[]): Group[] {
  const groups = new Map<string, Group>();
  for (const { id, tone, evaluation } of judged) {
    const protocol = protocolOf(evaluation);
    const numEpisodes = number(at(evaluation, "protocol", "num_episodes"));
    const defaults = entries(at(evaluation, "default_gaits")).slice(0, 16);
    // Another version of a robot's default gait is another measure, too.
    const key = JSON.stringify([[...protocol], defaults.map(([name, report]) => [name, number(at(report, "speed_m_per_s"))])]);
    let group = groups.get(key);
    if (!group) {
      const gaits = defaults.map(([name, report]) => ({ name: `${name} (default)`, tone: null, report, numEpisodes, ratio: null, ratioInterval: null }));
      group = { protocol, gaits };
      groups.set(key, group);
    }
    const learned = {
      name: id,
      tone,
      report: at(evaluation, "policy"),
      numEpisodes,
      ratio: number(at(evaluation, "speed_ratio")),
      ratioInterval: interval(at(evaluation, "speed_ratio_ci")),
    };
    group.gaits.splice(group.gaits.length - defaults.length, 0, learned);
  }
  return [...groups.values()];
}

function protocolOf(evaluation: unknown): Map<string, string> {
  const known = entries(at(evaluation, "protocol")).slice(0, 32);
  return new Map(known.map(([key, value]) => [key, text(value) ?? JSON.stringify(value)?.slice(0, 100) ?? ""]));
}

/** In what protocols differ: their keys. */
function differences(groups: readonly Group[]): string[] {
  const keys = new Set(groups.flatMap(({ protocol }) => [...protocol.keys()]));
  const differing = [...keys].filter((key) => new Set(groups.map(({ protocol }) => protocol.get(key))).size > 1);
  return differing.length > 0 ? differing : ["speeds of the default gaits"];
}

function table(group: Group, groups: readonly Group[]): HTMLElement {
  const said = (key: string) => group.protocol.get(key) ?? "\u2013";
  const words = `${said("robot")}: ${said("num_episodes")} episodes of ${said("episode_s")} s on a slope of ${said("slope_deg")} degrees, seed ${said("seed")}`;
  const special = groups.length > 1 ? differences(groups).map((key) => `${key}: ${said(key)}`) : [];
  const head = COLUMNS.map(({ title, unit }) => element("th", { scope: "col", class: "n" }, title, element("small", {}, unit)));
  const rows = group.gaits.map((gait) => {
    const swatch = element("span", { class: "swatch" });
    if (gait.tone) swatch.style.background = colour(gait.tone);
    const cells = COLUMNS.map(({ read }) => element("td", { class: "n" }, read(gait)));
    return element("tr", {}, element("th", { scope: "row" }, swatch, gait.name), ...cells);
  });
  const description = [words, ...special].join("; ");
  return element(
    "div",
    {},
    element("p", { class: "quiet" }, description),
    element(
      "div",
      { class: "scroll", tabindex: 0, role: "region", "aria-label": `Verdicts, ${description}` },
      element(
        "table",
        {},
        element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "gait"), ...head)),
        element("tbody", {}, ...rows),
      ),
    ),
  );
}

function withInterval(value: number | null, ends: [number, number] | null, decimals: number): string {
  const main = fixed(value, decimals);
  return value !== null && ends ? `${main} (${fixed(ends[0], decimals)} to ${fixed(ends[1], decimals)})` : main;
}

function times(value: number | null, factor: number): number | null {
  return value === null ? null : value * factor;
}
