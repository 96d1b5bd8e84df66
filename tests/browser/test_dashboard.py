#!/usr/bin/env python3
"""Opens the page of `canter serve` in headless Chromium while a training runs, and fails where a reader would be let down.

    test_dashboard.py CANTER FOLDER [SCREENSHOTS]

CANTER is the program, built with its page. FOLDER is emptied; runs are trained in it.
"""

import http.client
import json
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.parse

from browser import Browser, check

# A training of a second.
SHORT = [
    "task.episode_s=0.5", "network.actor_hidden=16", "network.critic_hidden=16", "training.num_environments=4",
    "training.horizon=32", "training.max_env_steps=1024", "ppo.minibatch_size=64", "evaluation.num_episodes=2",
    "evaluation.episode_s=3.0",
]
# One that ends when it is told to.
LONG = ["training.max_env_steps=100000000", "training.horizon=64"]

HOSTILE = "<img src=x onerror=\"document.title='taken over'\">"


class Server:
    """`canter serve` of a folder; told to stop at the end."""

    def __init__(self, canter, folder, port=0):
        command = [canter, "serve", str(folder), "--port", str(port)]
        self.folder = folder
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        said = self.process.stdout.readline()
        check("http://127.0.0.1:" in said, f"canter serve says {said!r} {self.process.stderr.read() if not said else ''}")
        self.port = int(said.split("http://127.0.0.1:")[1].split("/")[0])
        self.url = f"http://127.0.0.1:{self.port}/"

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        code = self.process.wait(timeout=10)
        check(code == 0, f"canter serve ends with {code} after Ctrl-C")

    def ask(self, target, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        connection.request("GET", target, headers=headers)
        response = connection.getresponse()
        return response.status, response.read()


def train(canter, run, settings, **options):
    sets = [word for setting in settings for word in ("--set", setting)]
    return subprocess.Popen([canter, "train", "--out", str(run), *sets], stdout=subprocess.DEVNULL, **options)


def make_runs(canter, folder):
    """A run, a second one in a folder of its own, and what somebody hostile might leave."""
    runs = folder / "runs"
    for name in ("first", "more/second"):
        (runs / name).parent.mkdir(parents=True, exist_ok=True)
        check(train(canter, runs / name, [*SHORT, f"seed={len(name)}"]).wait() == 0, f"the training of {name} failed")
    hostile = runs / HOSTILE
    shutil.copytree(runs / "first", hostile)
    verdict = json.loads((hostile / "eval.json").read_text())
    verdict["default_gait"] = verdict["protocol"]["robot"] = HOSTILE
    verdict["policy"]["speed_m_per_s"] = {"toString": HOSTILE}
    (hostile / "eval.json").write_text(json.dumps(verdict))
    learned = json.loads((hostile / "trajectories/learned.json").read_text())
    learned["label"], learned["foot_m"] = HOSTILE, [[["many"]]]
    (hostile / "trajectories/learned.json").write_text(json.dumps(learned))
    (hostile / "config.toml").write_text(f"robot = '''{HOSTILE}'''\nseed = 1\n")
    (hostile / "metrics.jsonl").write_text('{"env_steps": "<b>", "speed_m_per_s": []}\n{"env_steps": 1e300}\nnonsense\n[]\n7\n')
    broken = runs / "broken"
    broken.mkdir()
    for name in ("config.toml", "metrics.jsonl", "eval.json", "lock"):
        (broken / name).write_bytes(b"\xff\xfe{[<script>alert(1)</script>")
    secret = folder / "secret"
    shutil.copytree(runs / "first", secret)
    (runs / "linked").symlink_to(secret)
    return runs


def row(run):
    return f"document.querySelector('[data-run=' + CSS.escape({json.dumps(run)}) + ']')"


def select(browser, server, *runs, view=None, **options):
    """Opens the page with these runs shown, as a link or a reload would."""
    parts = [("run", run) for run in runs] + ([("view", view)] if view else [])
    browser.open(server.url + "#" + urllib.parse.urlencode(parts, quote_via=urllib.parse.quote), **options)
    for run in runs:
        browser.until(f"!!{row(run)}", f"{run} is not listed")


def points(browser, metric="speed_m_per_s"):
    return f"Number((document.querySelector('[data-metric={metric}]') || {{dataset: {{}}}}).dataset.points || 0)"


def check_no_complaints(browser, server, page, ours=()):
    complaints = browser.complaints(lambda url: url.startswith(server.url))
    complaints = [complaint for complaint in complaints if not any(known in complaint for known in ours)]
    check(not complaints, f"{page}: {complaints}")


def check_live(browser, server, canter, runs):
    """A training appears, its curve grows and its end is seen, all without a reload."""
    select(browser, server)
    browser.evaluate("window.isTheSamePage = true")
    training = train(canter, runs / "live", LONG, stderr=subprocess.DEVNULL)
    try:
        browser.until(f"{row('live')} && {row('live')}.dataset.state === 'training'", "a training does not appear")
        browser.evaluate(f"{row('live')}.querySelector('input[type=checkbox]').click()")
        browser.until(f"{points(browser)} >= 2", "the curve of a training is not drawn")
        before = browser.evaluate(points(browser))
        browser.until(f"{points(browser)} >= {before} + 3", "the curve of a training does not grow")
    finally:
        training.send_signal(signal.SIGINT)
        code = training.wait(timeout=60)
    check(code == 130, f"the training ended with {code}")
    browser.until(f"{row('live')}.dataset.state === 'stopped'", "the end of a training is not seen")
    lines = len((runs / "live/metrics.jsonl").read_text().splitlines())
    browser.until(f"{points(browser)} === {lines}", f"not all {lines} iterations are drawn")
    check(browser.evaluate("window.isTheSamePage"), "the page was loaded again")
    check_no_complaints(browser, server, "a live run")


def check_end(browser, server, canter, runs):
    """A run that is shown before its end gets its verdict and its robot without a reload."""
    select(browser, server, "live")
    browser.evaluate("window.isTheSamePage = true")
    browser.until("document.getElementById('verdict-notes').textContent.includes('live')", "a run waits for no verdict")
    # All its env steps are done, so that what is left is to judge it.
    config = (runs / "live/config.toml").read_text()
    ended, number = re.subn(r"(?m)^max_env_steps = .*", "max_env_steps = 1", config)
    check(number == 1, "config.toml has no max_env_steps")
    (runs / "live/config.toml").write_text(ended)
    code = subprocess.run([canter, "resume", str(runs / "live")], stdout=subprocess.DEVNULL, timeout=300).returncode
    check(code == 0, f"canter resume ended with {code}")
    browser.until(f"{row('live')}.dataset.state === 'finished'", "a verdict is not seen")
    judged = "[...document.querySelectorAll('#verdict-tables tbody th')].some(name => name.textContent === 'live')"
    browser.until(judged, "a verdict does not appear")
    browser.until("document.getElementById('canvas').dataset.gaits === '2'", "a robot does not appear")
    check(browser.evaluate("window.isTheSamePage"), "the page was loaded again")
    check_no_complaints(browser, server, "a run's end")


def check_nothing_is_lost(browser, server):
    """Who reads a table or has zoomed in is not disturbed by the next answer of the server."""
    select(browser, server, "first", "more/second", width=390)
    table = "document.querySelector('#verdict-tables .scroll')"
    browser.until(f"{table} && {points(browser)} >= 16", "no verdict or curve is drawn")
    browser.evaluate(f"{table}.scrollLeft = 60; {table}.focus()")
    plot = "document.querySelector('[data-metric=speed_m_per_s] .u-over')"
    box = browser.evaluate(
        f"{plot}.scrollIntoView({{block: 'center'}}), (b => [b.x, b.y, b.width, b.height])({plot}.getBoundingClientRect())")
    canvas = "document.querySelector('[data-metric=speed_m_per_s] canvas').toDataURL()"
    whole = browser.evaluate(canvas)
    middle = box[1] + box[3] / 2
    for kind, part, buttons in (("mousePressed", 0.3, 1), ("mouseMoved", 0.6, 1), ("mouseReleased", 0.6, 0)):
        x = box[0] + part * box[2]
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=middle, button="left", buttons=buttons, clickCount=1)
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=1, y=1)
    time.sleep(0.3)
    zoomed = browser.evaluate(canvas)
    check(zoomed != whole, "dragging over a chart does not zoom in")
    # A run that changes has the charts drawn again.
    with open(server.folder / "more/second/metrics.jsonl", "a") as metrics:
        metrics.write('{"env_steps": 1000000, "speed_m_per_s": 0.1}\n')
    browser.until(f"{points(browser)} >= 17", "a new iteration is not drawn")
    time.sleep(4)
    check(browser.evaluate(canvas) == zoomed, "a chart does not stay where somebody has zoomed in")
    check(browser.evaluate(f"{table}.scrollLeft") == 60, "a table scrolls back")


def check_many(browser, server, runs):
    """Eight runs are loaded at once, again and again."""
    names = [f"many/{number}" for number in range(8)]
    for name in names:
        shutil.copytree(runs / "first", runs / name)
    lines = len((runs / "first/metrics.jsonl").read_text().splitlines())
    for _ in range(5):
        select(browser, server, *names)
        browser.until(f"{points(browser)} === {8 * lines}", "eight runs are not drawn")
    check_no_complaints(browser, server, "eight runs")
    shutil.rmtree(runs / "many")


def check_comparison(browser, server, runs):
    """Both verdicts stand side by side, as the files have them."""
    select(browser, server, "first", "more/second")
    text = "document.querySelector('main').textContent"
    for name in ("first", "more/second"):
        speed = json.loads((runs / name / "eval.json").read_text())["policy"]["speed_m_per_s"]
        shown = f"{speed:.3f}".replace("-", "\u2212")
        browser.until(f"{text}.includes({json.dumps(shown)})", f"the speed of {name}, {shown}, is not on the page")
    lines = sum(len((runs / name / "metrics.jsonl").read_text().splitlines()) for name in ("first", "more/second"))
    browser.until(f"{points(browser)} === {lines}", f"not all {lines} iterations of two runs are drawn")


def check_3d(browser, server, shots):
    select(browser, server, "first", view="first")
    canvas = "document.querySelector('canvas[data-time]')"
    clock = f"Number({canvas}.dataset.time)"
    browser.until(f"{canvas} && Number({canvas}.dataset.gaits) >= 2", "the learned gait does not stand beside the default one")
    playing = "[...document.querySelectorAll('button')].find(button => /^(play|pause)/i.test(button.textContent.trim() || button.ariaLabel))"
    if browser.evaluate(f"/^play/i.test({playing}.textContent.trim() || {playing}.ariaLabel)"):
        browser.evaluate(f"{playing}.click()")
    # So slowly the episode's end does not come between two looks.
    browser.evaluate("document.getElementById('pace').value = '0.1'")
    before = browser.evaluate(clock)
    browser.until(f"{clock} > {before} + 0.05 || {clock} < {before}", "the 3D clock does not run")
    browser.evaluate(f"{playing}.click()")
    time.sleep(0.3)
    paused = browser.evaluate(clock)
    first = browser.picture("canvas[data-time]")
    time.sleep(0.3)
    check(browser.evaluate(clock) == paused, "the 3D clock runs on after a pause")
    scrubber = "document.querySelector('input[type=range]')"
    browser.evaluate(f"{scrubber}.value = Number({scrubber}.max) / 2; {scrubber}.dispatchEvent(new Event('input', {{bubbles: true}}))")
    browser.until(f"{clock} !== {paused}", "the slider does not move the 3D clock")
    time.sleep(0.3)
    second = browser.picture("canvas[data-time]")
    check(len(first) > 5000, f"the 3D picture is nearly empty: {len(first)} bytes as PNG")
    check(first != second, "the robots do not move in 3D")
    if shots:
        (shots / "dashboard-3d.png").write_bytes(second)


def check_report(browser, server):
    """A run's own page works, but as a page of no origin: whoever wrote it cannot ask the server."""
    browser.open(server.url + "report?run=first")
    browser.until("!!document.querySelector('#replay.ready')", "a report's own script does not run")
    check(browser.evaluate("self.origin") == "null", "a report has the server's origin")
    check_no_complaints(browser, server, "a report")
    asked = f"fetch('{server.url}api/runs').then(() => 'read', () => 'refused')"
    answer = browser.call("Runtime.evaluate", expression=asked, awaitPromise=True, returnByValue=True)
    check(answer["result"]["value"] == "refused", "a report can read the runs")


def check_removed(browser, server, runs):
    """A run that is removed while it is shown leaves nothing behind."""
    shutil.copytree(runs / "first", runs / "removed")
    select(browser, server, "removed", "first")
    lines = len((runs / "first/metrics.jsonl").read_text().splitlines())
    browser.until(f"{points(browser)} === {2 * lines}", "not all iterations of two runs are drawn")
    shutil.rmtree(runs / "removed")
    browser.until(f"!{row('removed')} && {points(browser)} === {lines}", "a removed run is still shown")
    check("removed" not in browser.evaluate("location.hash"), "a removed run is still in the address")


def check_hostile(browser, server):
    select(browser, server, HOSTILE, "broken", view=HOSTILE)
    shown = f"{row(HOSTILE)}.textContent.includes({json.dumps(HOSTILE)})"
    browser.until(shown, "a hostile name is not shown as text")
    time.sleep(2)
    check(browser.evaluate("document.title") != "taken over", "a hostile name ran")
    check(not browser.evaluate("document.querySelector('img, script:not([src])')"), "a hostile name became an element")
    # The page lives on: another run can still be shown.
    browser.evaluate(f"{row('first')}.querySelector('input[type=checkbox]').click()")
    browser.until(f"{points(browser)} >= 8", "after hostile files another run's curve is not drawn")
    check_no_complaints(browser, server, "hostile files", ours=("status of 422", "status of 404"))


def check_refusals(server):
    own = f"127.0.0.1:{server.port}"
    expected = [
        (200, "/api/runs", {"Host": own}),
        (421, "/api/runs", {"Host": "evil.example"}),
        (403, "/api/runs", {"Host": own, "Origin": "http://evil.example"}),
        (403, "/api/runs", {"Host": own, "Sec-Fetch-Site": "cross-site"}),
        (403, "/api/eval?run=../secret", {"Host": own}),
        (403, "/api/eval?run=linked", {"Host": own}),
        (404, "/../secret/eval.json", {"Host": own}),
    ]
    for status, target, headers in expected:
        found, body = server.ask(target, **headers)
        check(found == status, f"{target} with {headers}: {found} instead of {status}: {body[:200]}")


def check_other_origin(browser, server):
    """A page from elsewhere cannot read an answer, whatever it tries."""
    browser.open("data:text/html,<title>elsewhere</title>")
    asked = f"fetch('{server.url}api/runs').then(r => r.text()).then(() => 'read', () => 'refused')"
    answer = browser.call("Runtime.evaluate", expression=asked, awaitPromise=True, returnByValue=True)
    check(answer["result"]["value"] == "refused", "another page can read the runs")


def check_lost_server(browser, canter, runs):
    server = Server(canter, runs)
    try:
        select(browser, server, "first")
        lost = "(element => element && !element.hidden && element.offsetHeight > 0)(document.getElementById('connection'))"
        check(not browser.evaluate(lost), "the page complains while the server is there")
        server.stop()
        browser.until(lost, "the page does not say that the server is gone")
        server = Server(canter, runs, server.port)
        browser.until(f"!{lost}", "the page does not go on when the server is back")
    finally:
        server.process.kill()


def main():
    canter, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    shots = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if shots:
        shots.mkdir(parents=True, exist_ok=True)
    runs = make_runs(canter, folder)
    server = Server(canter, runs)
    with tempfile.TemporaryDirectory(prefix="canter-browser-", ignore_cleanup_errors=True) as profile:
        browser = Browser(profile)
        try:
            check_live(browser, server, canter, runs)
            check_end(browser, server, canter, runs)
            check_comparison(browser, server, runs)
            check_many(browser, server, runs)
            check_3d(browser, server, shots)
            check_report(browser, server)
            check_removed(browser, server, runs)
            check_hostile(browser, server)
            check_nothing_is_lost(browser, server)
            check_refusals(server)
            check_other_origin(browser, server)
            for width, scheme in ((1280, "light"), (1280, "dark"), (390, "light")):
                select(browser, server, "first", "more/second", "live", view="first", width=width, scheme=scheme)
                browser.until(f"{points(browser)} > 8", "no curve is drawn")
                browser.until("!!document.querySelector('canvas[data-time]')", "no robot is drawn")
                time.sleep(1)
                wide = browser.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
                check(wide <= 0, f"the page is {wide} px too wide for {width} px")
                background = browser.evaluate("getComputedStyle(document.body).backgroundColor")
                is_dark = sum(int(part) for part in background.strip("rgb()").split(",")) < 200
                check(is_dark == (scheme == "dark"), f"in {scheme} the page has the ground {background}")
                if shots:
                    browser.screenshot(shots / f"dashboard-{'phone' if width < 500 else scheme}.png")
                check_no_complaints(browser, server, f"{width} px, {scheme}")
            check_lost_server(browser, canter, runs)
        finally:
            browser.close()
            server.process.kill()
    print(f"{server.url}: passed")


if __name__ == "__main__":
    main()
