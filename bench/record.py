"""From the parts of a benchmark run to its README.md and results.json."""

import json
import math
import statistics

# The peers' own pinned versions that a reader wants to know.
PACKAGES = ("mujoco", "mujoco-mjx", "jax", "torch", "stable_baselines3", "gymnasium", "numpy")

# A shorter training shows no growth.
LONG_ENV_STEPS = 10_000_000


class Parts:
    """The numbers of the parts that have run; a part that has not, or failed, is None."""

    def __init__(self, folder):
        self.envelopes = {path.stem: json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))}

    def __getitem__(self, name):
        return self.envelopes.get(name, {}).get("result")

    def starting_with(self, prefix):
        return [part["result"] for name, part in self.envelopes.items()
                if name.startswith(prefix) and "result" in part]

    @property
    def errors(self):
        return {name: part["error"] for name, part in self.envelopes.items() if "error" in part}


def median_seconds(trainings):
    """Median over the trainings, of which one that never reached the speed took for ever; None: there are none."""
    seconds = [math.inf if row["seconds"] is None else row["seconds"] for row in trainings]
    return statistics.median(seconds) if seconds else None


def row_of(rows, key, value):
    return next((row for row in rows or [] if row[key] == value), None)


def ratio(a, b):
    """a / b, or None where one is missing."""
    return None if a is None or b is None else a / b


def sb3_overheads(parts):
    """Cost of an env step above the physics that it contains, by vector environment [reference mj_step]."""
    if not (parts["sb3-cost"] and parts["floor"]):
        return {}
    floor = parts["floor"]
    reference_ns, preset_ns = floor["reference_mj_step_ns"][1], floor["preset_mj_step_ns"][1]
    above_ns = lambda row: 1e9 * row["collect_s_per_env_step"] - floor["num_substeps"] * preset_ns
    return {row["vec_env"]: above_ns(row) / reference_ns for row in parts["sb3-cost"]}


def figures(parts):
    """The record's numbers; None where the part that gives one is missing."""
    collect, growth, startup, floor = parts["collect"] or {}, parts["growth"] or {}, parts["startup"], parts["floor"]
    threads, long = growth.get("threads"), parts["long"]
    one, two = row_of(threads, "threads", 1), row_of(threads, "threads", 2)
    canter = median_seconds(parts.starting_with("time-"))
    ours, best = (median_seconds(parts.starting_with(f"sb3-time-{kind}-")) for kind in ("canter", "best"))
    sb3 = [seconds for seconds in (ours, best) if seconds is not None]
    learned = [row["speed_ratio"] for row in parts.starting_with("package-learn-")]
    with_64 = row_of(growth.get("environments"), "environments", 64)
    return {
        "reference_mj_step_ns": floor and floor["reference_mj_step_ns"][1],
        "collect_over_mj_step": collect.get("ratio"),
        "overhead_per_env_step": collect.get("overhead_in_mj_steps"),
        "sb3_overhead_per_env_step": min(sb3_overheads(parts).values(), default=None),
        "update_per_sample": collect.get("update_in_mj_steps_per_sample"),
        "update_share": threads and threads[-1]["update_share"],
        "threads_2_over_1": ratio(two and two["env_steps_per_s"], one and one["env_steps_per_s"]),
        "seconds_to_1_5x": canter,
        "sb3_seconds_to_1_5x": min(sb3, default=None),
        "sb3_seconds_to_1_5x_with_our_settings": ours,
        "sb3_seconds_to_1_5x_with_its_best": best,
        "version_ms": startup and statistics.median(startup["version_ms"]),
        "first_env_step_ms": startup and statistics.median(startup["first_env_step_ms"]),
        "resident_mb_with_64_environments": with_64 and with_64["peak_resident_mb"],
        "policy_step_ns": parts["criterion"] and parts["criterion"]["policy_act"][1],
        "python_over_collecting": max((row["vector_over_rust_wall"][1] for row in parts["package-cost"] or []), default=None),
        "python_sb3_speed_ratio": statistics.median(learned) if learned else None,
        "growth_mb_over_10m_env_steps": long["growth_mb"] if long and long["env_steps"] >= LONG_ENV_STEPS else None,
    }


def targets(figure):
    """Name, figure and whether it is enough, for each target; None: not measured."""
    at_most = lambda value, limit: None if value is None else value <= limit
    at_least = lambda value, limit: None if value is None else value >= limit
    overhead = ratio(figure["sb3_overhead_per_env_step"], figure["overhead_per_env_step"])
    seconds, sb3_seconds = figure["seconds_to_1_5x"], figure["sb3_seconds_to_1_5x"]
    sb3_over = ratio(sb3_seconds, seconds)
    ms, mb = figure["first_env_step_ms"], figure["resident_mb_with_64_environments"]
    return [
        ("collecting over bare `mj_step`, at most 1.05", figure["collect_over_mj_step"],
         at_most(figure["collect_over_mj_step"], 1.05)),
        ("updating's share of training, at most 0.10", figure["update_share"], at_most(figure["update_share"], 0.10)),
        ("SB3's overhead per env step over ours, at least 20", overhead, at_least(overhead, 20)),
        ("2 threads over 1, at least 1.8", figure["threads_2_over_1"], at_least(figure["threads_2_over_1"], 1.8)),
        ("time to 1.5 times the default speed [s], at most 30", seconds, at_most(seconds, 30)),
        ("SB3's time over ours, at least 5", sb3_over, at_least(sb3_over, 5)),
        ("`canter --version` [ms], under 20", figure["version_ms"], at_most(figure["version_ms"], 20)),
        ("start to first env step [ms], at most 300", ms, at_most(ms, 300)),
        ("memory with 64 environments [MB], at most 150", mb, at_most(mb, 150)),
        ("one step of a policy [ns], at most 1000", figure["policy_step_ns"], at_most(figure["policy_step_ns"], 1000)),
        ("`canter.VectorEnv` from Python over collecting in Rust, at most 1.3", figure["python_over_collecting"],
         at_most(figure["python_over_collecting"], 1.3)),
        ("SB3 on it: speed over the default gait's, at least 1.3", figure["python_sb3_speed_ratio"],
         at_least(figure["python_sb3_speed_ratio"], 1.3)),
        ("growth over 10 million env steps [MB], at most 1", figure["growth_mb_over_10m_env_steps"],
         at_most(figure["growth_mb_over_10m_env_steps"], 1)),
    ]


def number(value):
    """Three digits, or as many as an integer has."""
    if value is None:
        return "-"
    if isinstance(value, (str, int)):
        return str(value)
    if not math.isfinite(value):
        return "not reached"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def table(head, rows):
    lines = [head, ["---"] * len(head), *([number(cell) for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def spread(quartiles):
    first, median, third = (number(value) for value in quartiles)
    return f"{median} ({first} to {third})"


def section(title, text, *tables):
    return "\n".join([f"## {title}", "", text, "", *tables])


def target_section(figure):
    words = {None: "not measured", True: "met", False: "missed"}
    rows = [(name, value, words[met]) for name, value, met in targets(figure)]
    return section("Targets", "One line for each; the tables below have what it is made of.",
                   table(["target", "figure", ""], rows))


def floor_section(floor):
    unit = floor["reference_mj_step_ns"]
    text = (f"One reference `mj_step` ({floor['reference_physics_dt_s']} s, walking, level ground) takes {spread(unit)}"
            f" ns, one of the preset ({floor['preset_physics_dt_s']} s) {spread(floor['preset_mj_step_ns'])} ns:"
            " median and quartiles.")
    rows = [(row["threads"], row["mj_steps_per_s"]) for row in floor["reference_by_threads"]]
    return section("The floor: bare C calls", text, table(["threads", "reference `mj_step`s per second"], rows))


def collect_section(collect):
    rows = [
        ("collecting over bare `mj_step`", collect["ratio"], spread_between(collect["ratio_ci"])),
        ("overhead per env step [reference `mj_step`]", collect["overhead_in_mj_steps"], ""),
        ("update per sample [reference `mj_step`]", collect["update_in_mj_steps_per_sample"], ""),
        ("env steps per second, collecting, one thread", collect["collect_env_steps_per_s"], ""),
        ("update's share, one thread", collect["training_update_share"], ""),
    ]
    return section("Collecting and updating on one thread",
                   f"Median of {collect['num_pairs']} pairs of columns, each of {collect['horizon']} env steps.",
                   table(["", "median", "95 % interval"], rows))


def spread_between(interval):
    return " to ".join(number(value) for value in interval)


def criterion_section(found):
    rows = [(name, median, f"{number(low)} to {number(high)}") for name, (low, median, high) in found.items()]
    return section("Parts", "Medians by criterion. `ppo_update`, `collect` and `iteration` are whole rollouts of the"
                   " preset's size on one thread.", table(["", "ns", "95 % interval"], rows))


def growth_section(growth):
    head = ["", "env steps/s", "collecting [s]", "updating [s]", "update's share", "peak memory [MB]"]
    tables = []
    for key, rows in growth.items():
        cells = [(row[key], row["env_steps_per_s"], spread(row["collect_s"]), spread(row["update_s"]),
                  row["update_share"], row["peak_resident_mb"]) for row in rows]
        tables.append(table([key, *head[1:]], cells))
    few, many = growth["environments"][0], growth["environments"][-1]
    each = 1e3 * (many["peak_resident_mb"] - few["peak_resident_mb"]) / (many["environments"] - few["environments"])
    return section("How cost grows", "Each row is a process of its own; the other sizes are the preset's. Times are of one"
                   f" iteration, median and quartiles. An environment with its part of the rollout takes {number(each)}"
                   " kB.", *tables)


def time_section(parts):
    rows = []
    for name, trainings in [("canter", parts.starting_with("time-")),
                            ("SB3, canter's settings", parts.starting_with("sb3-time-canter-")),
                            ("SB3, its best", parts.starting_with("sb3-time-best-"))]:
        each = ", ".join(f"not in {row['env_steps']} env steps" if row["seconds"] is None else number(row["seconds"])
                         for row in trainings)
        memory = [row.get("peak_resident_mb") or row["resident_mb"] for row in trainings]
        rows.append((name, median_seconds(trainings), each, statistics.median(memory) if memory else None))
    return section("Time to 1.5 times the default speed", "Seconds on 2 cores until the second evaluation in a row at or"
                   " above it, each of 20 episodes; evaluations are counted.",
                   table(["", "median [s]", "each seed [s]", "memory [MB]"], rows))


def startup_section(startup):
    rows = [(name, statistics.median(times), min(times), max(times)) for name, times in startup.items()]
    return section("Start-up", "Wall times of whole processes.", table(["", "median [ms]", "least", "most"], rows))


def step_section(step):
    head = ["gait", *(f"{dt_s} s" for dt_s in step["steps_s"]), "0.002 s to the finest", "0.005 s to the finest"]
    percent = lambda share: f"{100 * share:+.1f} %"
    rows = [(row["gait"], *(f"{speed:.3f} ({falls})" for speed, falls in zip(row["speeds_m_per_s"], row["falls"])),
             percent(row["change_at_0_002"]), percent(row["change_at_0_005"])) for row in step["rows"]]
    far = [row["gait"] for row in step["rows"] if abs(row["change_at_0_005"]) > 0.05]
    return section("The physics step", f"Speed [m/s] over 20 episodes of the default gaits and of policies after"
                   f" {step['env_steps']} env steps of training at 0.005 s, judged with finer and coarser physics steps; in"
                   f" brackets episodes that fell. More than 5 % from the finest step at 0.005 s: "
                   f"{', '.join(far) if far else 'none'}.", table(head, rows))


def check_section(check):
    rows = [(row["physics"], row["env_steps"], row["accident"] or "none", row["observation_difference"],
             row["reward_difference"]) for row in check["episodes"]]
    speeds = (number(check[key]) for key in ("prior_speed_m_per_s", "canters_prior_speed_m_per_s"))
    return section("Do the peers do the same work?", "The Python task repeats canter's episodes; the largest differences"
                   f" may be {check['tolerance']}. Over whole evaluations the prior walks {' and '.join(speeds)} m/s.",
                   table(["physics", "env steps", "accident", "observations differ by", "rewards"], rows))


def sb3_cost_section(parts):
    overheads = sb3_overheads(parts)
    rows = [(row["vec_env"], 1 / row["collect_s_per_env_step"], overheads.get(row["vec_env"]),
             1e9 * row["update_s_per_sample"]) for row in parts["sb3-cost"]]
    return section("Stable-Baselines3 on one thread", "The overhead is what an env step costs above its physics as the"
                   " floor has it; the policy's forward pass is part of it, as it is of canter's.",
                   table(["vector environment", "env steps/s, collecting", "overhead per env step [reference `mj_step`]",
                          "update per sample [ns]"], rows))


def sb3_section(parts):
    head = ["vector environment", "threads", "minibatch", "env steps/s", "update's share", "memory [MB]"]
    cells = lambda rows: [(row["vec_env"], row["threads"], row["batch_size"], row["env_steps_per_s"],
                           row["update_share"], row["resident_mb"]) for row in rows]
    sweep, best = parts["sb3-sweep"], parts["sb3-best"]
    tables = [table(head, cells(sweep["vec_envs"])), table(head, cells(sweep["batch_sizes"]))]
    if best:
        rows = [(row["settings"], row["batch_size"], row["seconds"], row["env_steps"]) for row in best["candidates"]]
        tables.append(table(["settings", "minibatch", "seconds to 1.5x", "env steps"], rows))
    return section("Stable-Baselines3's sweep", "First the vector environment and threads, then the minibatch, by speed;"
                   " then settings, by the time to 1.5 times the default speed from one seed.", *tables)


def physics_section(physics):
    rows = [(row["what"], row["threads"], row["robots"], row["mj_steps_per_s"]) for row in physics["rows"]]
    return section("MuJoCo from Python, physics only", f"Peak memory {number(physics['peak_resident_mb'])} MB.",
                   table(["", "threads", "robots", "reference `mj_step`s per second"], rows))


def mjx_section(mjx):
    if "unsupported" in mjx:
        return section("MJX on the processor", f"Not supported: {mjx['unsupported']}")
    rows = [("steps per second, all robots", mjx["mj_steps_per_s"]), ("compiling [s]", mjx["compile_s"]),
            ("peak memory [MB]", mjx["peak_resident_mb"])]
    return section("MJX on the processor, physics only", f"{mjx['robots']} robots in one call of {mjx['steps']} steps.",
                   table(["", ""], rows))


def package_section(parts):
    costs = [(row["environments"], row["threads"], row["rust_wall_us_per_env_step"], spread(row["vector_over_rust_wall"]),
              spread(row["sb3_over_rust_wall"]), spread(row["vector_over_rust_processor"]))
             for row in parts["package-cost"] or []]
    learned = [(row["seed"], row["env_steps"], row["seconds"], row["default_speed_m_per_s"], row["speed_m_per_s"],
                row["speed_ratio"], row["falls"]) for row in parts.starting_with("package-learn-")]
    return section(
        "The Python package", "Time of the same env steps, bit for bit, collected in Rust and repeated through the package, "
        "and trainings by Stable-Baselines3's PPO on it, measured as `canter eval` does.",
        table(["environments", "threads", "Rust [us]", "`VectorEnv` over Rust", "`sb3.VecEnv` over Rust",
               "`VectorEnv` over Rust, processor time"], costs),
        table(["seed", "env steps", "training [s]", "default [m/s]", "learned [m/s]", "ratio", "falls"], learned))


def long_section(long):
    return section("A long training", f"{long['env_steps']} env steps: the memory grew by {number(long['growth_mb'])} MB"
                   " after the first tenth.")


def error_section(errors):
    return section("What failed", "These parts have no numbers.",
                   *(f"- `{name}`: {' '.join(error.split())}" for name, error in errors.items()), "")


def versions_section(machine, requirements):
    pins = {line.strip() for path in requirements for line in path.read_text().splitlines()}
    chosen = sorted(pin for pin in pins if pin.split("==")[0] in PACKAGES)
    rows = [*machine.items(), ("peers", ", ".join(chosen))]
    return section("Machine and versions", "The load average is from before the start; `+` marks a changed commit.",
                   table(["", ""], [(name, value) for name, value in rows]))


def write(out, requirements):
    """Writes README.md and results.json of the record in this folder."""
    parts, machine = Parts(out / "parts"), json.loads((out / "machine.json").read_text())
    figure = figures(parts)
    # JSON has no infinity: a speed that was never reached is null, like a figure that was not measured.
    finite = {key: value if value is None or math.isfinite(value) else None for key, value in figure.items()}
    (out / "results.json").write_text(json.dumps({**machine, **finite}, indent=2) + "\n")
    budgets = sorted({part["budget"] for part in parts.envelopes.values()})
    warning = "" if budgets == ["full"] else "\n**Measured with tiny budgets: these numbers show that it runs, no more.**\n"
    notes = out / "notes.md"
    text = [f"# Benchmarks of {machine['date']} on {machine['cpu']}, {machine['cores']} cores\n{warning}\n"
            "Made by `bench/run`; [bench/README.md](../../README.md) says what each number means.\n",
            target_section(figure), *([notes.read_text()] if notes.exists() else [])]
    whole = {"floor": floor_section, "collect": collect_section, "criterion": criterion_section,
             "growth": growth_section, "startup": startup_section, "step": step_section, "check": check_section, "physics": physics_section,
             "mjx": mjx_section, "long": long_section}
    for name, section_of in whole.items():
        if parts[name]:
            text.append(section_of(parts[name]))
    if parts.starting_with("time-") or parts.starting_with("sb3-time-"):
        text.append(time_section(parts))
    if parts["sb3-cost"]:
        text.append(sb3_cost_section(parts))
    if parts["sb3-sweep"]:
        text.append(sb3_section(parts))
    if parts["package-cost"] or parts.starting_with("package-learn-"):
        text.append(package_section(parts))
    if parts.errors:
        text.append(error_section(parts.errors))
    text.append(versions_section(machine, requirements))
    (out / "README.md").write_text("\n".join(text))
