#!/usr/bin/env python3
"""Opens report pages in headless Chromium and fails where a reader would be let down.

    test_page.py FOLDER [SCREENSHOTS]

FOLDER has a run (`run/`, `runs/` of two) and a comparison (`compare/`) with their `report.html`, as the example
`sample_reports` of canter-report writes them.
"""

import json
import pathlib
import sys
import tempfile
import time

from browser import Browser, check


def cells(browser, table):
    """Rows of a table as they read."""
    return browser.evaluate(
        f"[...document.querySelectorAll('table.{table} tbody tr')].map(row => [...row.cells].map(cell => cell.textContent))"
    )


def shows(text, value, decimals):
    return text.replace("\u2212", "-").replace("\u202f", "").startswith(f"{value:.{decimals}f}")


def check_run_numbers(browser, folder):
    verdict = json.loads((folder / "eval.json").read_text())
    reports = [verdict["policy"], *(verdict["default_gaits"][name] for name in sorted(verdict["default_gaits"]))]
    rows = cells(browser, "gaits")
    check(len(rows) == len(reports), f"{len(rows)} gaits in the table, {len(reports)} in eval.json")
    for row, report in zip(rows, reports):
        expected = [
            (2, report["speed_m_per_s"], 3), (3, report["falls"], 0), (4, report["drift_m"], 2),
            (5, report["heading_deg"], 1), (6, report["height_std_m"] * 1e3, 1), (7, report["power_w"], 1),
            (8, report["cost_of_transport"], 2), (10, report["episode_return"], 1),
        ]
        for column, value, decimals in expected:
            check(shows(row[column], value, decimals), f"{row[0]}: {row[column]!r} on the page, {value} in eval.json")


def check_comparison_numbers(browser, folder):
    comparison = json.loads((folder / "compare.json").read_text())
    by_label = {rung["label"]: rung for rung in comparison["rungs"].values()}
    rows = cells(browser, "gaits")
    check(len(rows) == len(by_label), "a rung is missing in the table")
    for row in rows:
        rung = by_label[row[0]]
        check(shows(row[1], rung["speed_iqm"], 3), f"{row[0]}: {row[1]!r} on the page, {rung['speed_iqm']} in compare.json")
        falls = sum(seed["falls"] for seed in rung["seeds"])
        check(shows(row[5], falls, 0), f"{row[0]}: {row[5]!r} falls on the page, {falls} in compare.json")
    check(len(cells(browser, "claims")) == len(comparison["claims"]), "a claim is missing")


def check_figures(browser, names):
    for name in names:
        has_drawing = browser.evaluate(
            f"[...document.querySelectorAll('#fig-{name} svg')].some(svg => svg.getBoundingClientRect().height > 20"
            " && svg.querySelector('path, rect, circle'))"
        )
        check(has_drawing, f"figure {name} is not drawn")
        check(browser.evaluate(f"document.querySelector('#fig-{name} figcaption').textContent.length > 60"), f"{name}: no caption")


def check_replay(browser):
    state = "[document.getElementById('replay-scrub').value, document.querySelector('.gait .limb').getAttribute('d')]"
    time_now = "Number(document.getElementById('replay-scrub').value)"
    before = browser.evaluate(state)
    time.sleep(0.3)
    check(browser.evaluate(state) == before, "the replay moves before it is played")
    browser.evaluate("document.getElementById('replay-play').click()")
    browser.until(f"{time_now} > {float(before[0])} + 0.3", "the replay's clock does not run when played")
    check(browser.evaluate(state)[1] != before[1], "the replay's legs do not move when played")
    check(browser.evaluate("document.getElementById('replay-play').textContent") == "Pause", "no way to pause")
    browser.evaluate("document.getElementById('replay-play').focus()")
    browser.press(" ", "Space", 32, " ")
    paused = browser.evaluate(state)
    time.sleep(0.3)
    check(browser.evaluate(state) == paused, "the replay moves on after the space bar has paused it")
    browser.evaluate("document.getElementById('replay-scrub').focus()")
    browser.press("Home", "Home", 36)
    check(browser.evaluate(time_now) == 0, "the slider cannot be moved by keyboard")
    check(browser.evaluate(state)[1] != paused[1], "the slider does not move the legs")
    # A slow replay is as slow as it says: 0.25 s of the gait's time take about a second.
    browser.evaluate("document.querySelector('input[name=replay-speed][value=\"0.25\"]').click()")
    browser.evaluate("window.begun = performance.now(); document.getElementById('replay-play').click()")
    browser.until(f"{time_now} > 0.2", "the slow replay does not run")
    speed = browser.evaluate(f"{time_now} / (performance.now() - window.begun) * 1000")
    check(0.1 < speed < 0.35, f"the slow replay runs at {speed:.2f} of the speed")
    browser.evaluate("document.getElementById('replay-play').click()")


def check_grounds(browser):
    shown = (
        "[...document.querySelectorAll('.gait')].filter(card => !card.hidden && card.offsetHeight > 0)"
        ".map(card => card.querySelector('svg g').getAttribute('transform'))"
    )
    level = browser.evaluate(shown)
    check(level and set(level) == {"rotate(0)"}, f"the replay begins on {level}, not on level ground")
    browser.evaluate("document.querySelector('input[name=replay-ground][value=\"20\"]').click()")
    uphill = browser.evaluate(shown)
    check(uphill and set(uphill) == {"rotate(-20)"}, f"the replay shows {uphill} for 20 degrees uphill")


RECORDED = ["film-strip", "footfall", "foot-paths", "speed-per-step", "torque", "leg-space"]
FIGURES = {
    "run": ["ladder", "learning", "energy", "falls", *RECORDED],
    "runs": ["ladder", "learning", "energy", "falls", *RECORDED],
    "compare": [
        "ladder", "return", "uphill", "slope", "friction", "mass", "delay", "push", "energy", "falls", *RECORDED
    ],
}


def main():
    folder = pathlib.Path(sys.argv[1])
    shots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    if shots:
        shots.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="canter-browser-", ignore_cleanup_errors=True) as profile:
        browser = Browser(profile)
        try:
            for name, figures in FIGURES.items():
                page = folder / name / "report.html"
                for width, scheme in ((1280, "light"), (1280, "dark"), (375, "light")):
                    browser.open(page.resolve().as_uri(), width, scheme)
                    check_figures(browser, figures)
                    wide = browser.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
                    check(wide <= 0, f"{page} is {wide} px too wide for {width} px")
                    if shots:
                        kind = "phone" if width < 500 else scheme
                        browser.screenshot(shots / f"{name}-{kind}.png")
                    if (width, scheme) == (1280, "light"):
                        if name == "run":
                            check_run_numbers(browser, folder / name)
                        if name == "compare":
                            check_comparison_numbers(browser, folder / name)
                        check_replay(browser)
                        if name == "compare":
                            check_grounds(browser)
                            if shots:
                                browser.screenshot(shots / "compare-uphill.png", "#replay")
                    background = browser.evaluate("getComputedStyle(document.body).backgroundColor")
                    is_dark = sum(int(part) for part in background.strip("rgb()").split(",")) < 200
                    check(is_dark == (scheme == "dark"), f"{page} in {scheme} has the ground {background}")
                    complaints = browser.complaints(lambda url: url == page.resolve().as_uri())
                    check(not complaints, f"{page}: {complaints}")
                browser.open(page.resolve().as_uri(), 800)
                browser.call("Emulation.setEmulatedMedia", media="print")
                hidden = "getComputedStyle(document.getElementById('replay')).display === 'none'"
                check(browser.evaluate(hidden), f"{page} prints its replay, which cannot move on paper")
                check_figures(browser, figures)
                if shots:
                    browser.screenshot(shots / f"{name}-print.png")
                print(f"{page}: passed")
        finally:
            browser.close()


if __name__ == "__main__":
    main()
