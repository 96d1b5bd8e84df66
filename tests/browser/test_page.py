#!/usr/bin/env python3
"""Opens report pages in headless Chromium and fails where a reader would be let down.

    test_page.py FOLDER [SCREENSHOTS]

FOLDER has a run (`run/`, `runs/` of two) and a comparison (`compare/`) with their `report.html`, as the example
`sample_reports` of canter-report writes them. Python's standard library only: the browser is spoken to through a pipe.
Installs Debian's chromium if there is none and this is root.
"""

import base64
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

LIMIT_S = 60


def chromium():
    """Path of the browser; installed first if it has to be."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if shutil.which(name):
            return shutil.which(name)
    if os.geteuid() != 0:
        sys.exit("chromium is missing; install it with: sudo apt-get install -y chromium")
    print("installing chromium")
    subprocess.run(["apt-get", "update", "-q"], check=True, stdout=subprocess.DEVNULL)
    command = ["apt-get", "install", "-y", "-q", "--no-install-recommends", "chromium"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"})
    return shutil.which("chromium") or sys.exit("chromium was installed but is not in PATH")


class Browser:
    """A browser at the other end of two pipes: messages of the DevTools protocol, each ended by a zero byte."""

    def __init__(self, profile):
        to_read, self.to_write = os.pipe()
        self.from_read, to_answer = os.pipe()
        # The browser reads from descriptor 3 and writes to 4; moved out of the way first, lest one overwrite the other.
        ends = [os.dup(os.dup(os.dup(end))) for end in (to_read, to_answer)]

        def connect():
            for number, end in zip((3, 4), ends):
                os.dup2(end, number, inheritable=True)

        flags = [
            "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--remote-debugging-pipe", f"--user-data-dir={profile}", "about:blank",
        ]
        self.process = subprocess.Popen(
            [chromium(), *flags], preexec_fn=connect, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for end in (to_read, to_answer, *ends):
            os.close(end)
        self.unread, self.number, self.session, self.events = b"", 0, None, []

    def message(self):
        while b"\0" not in self.unread:
            more = os.read(self.from_read, 1 << 20)
            if not more:
                sys.exit("chromium went away")
            self.unread += more
        message, self.unread = self.unread.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **parameters):
        self.number += 1
        request = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            request["sessionId"] = self.session
        data = json.dumps(request).encode() + b"\0"
        while data:
            data = data[os.write(self.to_write, data):]
        while True:
            message = self.message()
            if message.get("id") == self.number:
                if "error" in message:
                    sys.exit(f"{method}: {message['error']['message']}")
                return message["result"]
            self.events.append(message)

    def open(self, path, width=1280, scheme="light"):
        """A fresh tab with the page, fully loaded."""
        self.session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=width < 500)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)
        self.events.clear()
        self.call("Page.navigate", url=path.resolve().as_uri())
        self.until("document.readyState === 'complete' && location.protocol === 'file:'", "the page does not load")

    def evaluate(self, expression):
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in answer:
            sys.exit(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def until(self, expression, complaint):
        end = time.monotonic() + LIMIT_S
        while not self.evaluate(expression):
            if time.monotonic() > end:
                sys.exit(f"FAILED: {complaint}")
            time.sleep(0.05)

    def press(self, key, code, number, text=""):
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=code, windowsVirtualKeyCode=number, text=text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=code, windowsVirtualKeyCode=number)

    def screenshot(self, path, selector=None):
        """Of the whole page, or of one element."""
        options = {}
        if selector:
            box = self.evaluate(
                f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
                " return {x: b.x + scrollX, y: b.y + scrollY, width: b.width, height: b.height}; })()"
            )
            options["clip"] = {**box, "scale": 1}
        data = self.call("Page.captureScreenshot", captureBeyondViewport=True, **options)["data"]
        path.write_bytes(base64.b64decode(data))

    def complaints(self, page):
        """Whatever reached the console as an error, and every request but for the page itself."""
        found = []
        for event in self.events:
            method, parameters = event.get("method"), event.get("params", {})
            if method == "Runtime.exceptionThrown":
                found.append(parameters["exceptionDetails"].get("text", "an exception"))
            elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning", "assert"):
                found.append(str(parameters["args"]))
            elif method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
                found.append(parameters["entry"]["text"])
            elif method == "Network.requestWillBeSent":
                url = parameters["request"]["url"]
                if not url.startswith("data:") and url.split("#")[0] != page.resolve().as_uri():
                    found.append(f"a request for {url}")
        return found

    def close(self):
        os.close(self.to_write)
        try:
            self.process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def check(holds, complaint):
    if not holds:
        sys.exit(f"FAILED: {complaint}")


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
                    browser.open(page, width, scheme)
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
                    complaints = browser.complaints(page)
                    check(not complaints, f"{page}: {complaints}")
                browser.open(page, 800)
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
