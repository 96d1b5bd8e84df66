// Questions to `canter serve`; docs/dashboard.md describes the answers.

import { at, interval, list, number, text, texts } from "./values";

/** Nobody answers: the server was ended, or the machine is out of reach. */
export class NoAnswer extends Error {}

/** After so long nobody answers [ms]: a tunnel may be dead without saying so. */
const PATIENCE_MS = 15_000;

/** Asks for JSON. A refusal is an Error with the server's reason. */
async function ask(path: string, parameters: Record<string, string> = {}): Promise<unknown> {
  const query = new URLSearchParams(parameters).toString();
  let response: Response;
  let answer: unknown;
  try {
    response = await fetch(query ? `${path}?${query}` : path, { signal: AbortSignal.timeout(PATIENCE_MS) });
    answer = await response.json();
  } catch (error) {
    throw new NoAnswer(String(error));
  }
  if (!response.ok) throw new Error(text(at(answer, "error")) ?? `the server says ${response.status}`);
  return answer;
}

export type State = "training" | "finished" | "stopped";

/** The verdict's main numbers, speeds in m/s. */
export interface Verdict {
  speed: number | null;
  defaultGait: string | null;
  ratio: number | null;
  ratioInterval: [number, number] | null;
  falls: number | null;
  numEpisodes: number | null;
}

/** A run in the list. */
export interface Run {
  id: string;
  state: State;
  robot: string | null;
  seed: number | null;
  /** How far the training is, and how far it should go [env steps]. */
  envSteps: number | null;
  maxEnvSteps: number | null;
  /** Of the last iteration [m/s]. */
  speed: number | null;
  /** Since something was written last [s]. */
  updatedS: number;
  verdict: Verdict | null;
  /** Names of the recorded gaits, the learned one first. */
  trajectories: string[];
  hasReport: boolean;
  problems: string[];
}

export interface Listing {
  folder: string;
  /** What to type for a first run. */
  hint: string;
  runs: Run[];
  reports: { id: string; kind: string }[];
  leftOut: string[];
}

export async function askForRuns(): Promise<Listing> {
  const answer = await ask("api/runs");
  return {
    folder: text(at(answer, "folder")) ?? "",
    hint: text(at(answer, "hint")) ?? "canter train",
    runs: list(at(answer, "runs")).flatMap((run) => readRun(run) ?? []),
    reports: list(at(answer, "reports")).map((report) => ({
      id: fullText(at(report, "id")),
      kind: text(at(report, "kind")) ?? "report",
    })),
    leftOut: texts(at(answer, "left_out")),
  };
}

/** What follows byte `from` of a run's metrics.jsonl. */
export interface MetricsAnswer {
  from: number;
  next: number;
  more: boolean;
  broken: number;
  lines: unknown[];
}

export async function askForMetrics(run: string, from: number): Promise<MetricsAnswer> {
  const answer = await ask("api/metrics", { run, from: String(from) });
  return {
    from: number(at(answer, "from")) ?? 0,
    next: number(at(answer, "next")) ?? 0,
    more: at(answer, "more") === true,
    broken: number(at(answer, "broken")) ?? 0,
    lines: list(at(answer, "lines")),
  };
}

/** A run's eval.json. */
export function askForEvaluation(run: string): Promise<unknown> {
  return ask("api/eval", { run });
}

/** A recorded episode. */
export function askForTrajectory(run: string, name: string): Promise<unknown> {
  return ask("api/trajectory", { run, name });
}

/** The address of a folder's own page. */
export function reportAddress(id: string): string {
  return `report?${new URLSearchParams({ run: id })}`;
}

function readRun(run: unknown): Run | null {
  const id = fullText(at(run, "id"));
  if (id === "") return null;
  const state = at(run, "state");
  return {
    id,
    state: state === "training" || state === "finished" ? state : "stopped",
    robot: text(at(run, "robot")),
    seed: number(at(run, "seed")),
    envSteps: number(at(run, "env_steps")),
    maxEnvSteps: number(at(run, "max_env_steps")),
    speed: number(at(run, "speed_m_per_s")),
    updatedS: number(at(run, "updated_s")) ?? 0,
    verdict: readVerdict(at(run, "verdict")),
    trajectories: list(at(run, "trajectories")).map(fullText),
    hasReport: at(run, "report") === true,
    problems: texts(at(run, "problems")),
  };
}

function readVerdict(verdict: unknown): Verdict | null {
  if (typeof verdict !== "object" || verdict === null) return null;
  return {
    speed: number(at(verdict, "speed_m_per_s")),
    defaultGait: text(at(verdict, "default_gait")),
    ratio: number(at(verdict, "ratio")),
    ratioInterval: interval(at(verdict, "ratio_ci")),
    falls: number(at(verdict, "falls")),
    numEpisodes: number(at(verdict, "num_episodes")),
  };
}

/** Names of files go back to the server, so they are not cut. */
function fullText(value: unknown): string {
  return typeof value === "string" ? value : "";
}
