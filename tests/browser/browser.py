"""A headless Chromium, spoken to through a pipe. Python's standard library only.

Installs Debian's chromium if there is none and this is root.
"""

import base64
import json
import os
import select
import shutil
import subprocess
import sys
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
            # WebGL is drawn by the processor.
            "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
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
            if not select.select([self.from_read], [], [], LIMIT_S)[0]:
                sys.exit(f"chromium has said nothing for {LIMIT_S} s")
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

    def open(self, url, width=1280, scheme="light"):
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
        self.call("Page.navigate", url=url)
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'", "the page does not load")

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
        path.write_bytes(self.picture(selector))

    def picture(self, selector=None):
        """The same as a PNG file's bytes."""
        options = {}
        if selector:
            box = self.evaluate(
                f"(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
                " return {x: b.x + scrollX, y: b.y + scrollY, width: b.width, height: b.height}; })()"
            )
            options["clip"] = {**box, "scale": 1}
        data = self.call("Page.captureScreenshot", captureBeyondViewport=True, **options)["data"]
        return base64.b64decode(data)

    def complaints(self, is_ours):
        """Whatever reached the console as an error, and every request for an address that is not `is_ours`."""
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
                if not url.startswith(("data:", "blob:")) and not is_ours(url.split("#")[0]):
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
