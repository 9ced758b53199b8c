"""A browser without a window, driven by the WebDriver protocol (W3C) of chromedriver: Debian's chromium and nothing else."""

import base64
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

FLAGS = ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--force-device-scale-factor=1", "--disable-dev-shm-usage"]


def installed():
    return shutil.which("chromedriver") is not None and pathlib.Path("/usr/bin/chromium").exists()


class Browser:
    """One window of width x height. Use as a context."""

    def __init__(self, width=1320, height=1000):
        self.profile = tempfile.TemporaryDirectory(prefix="tissuewarp-browser-", ignore_cleanup_errors=True)
        self.driver = subprocess.Popen([shutil.which("chromedriver"), "--port=0"], stdout=subprocess.PIPE, text=True,
                                       stderr=subprocess.DEVNULL, env={**os.environ, "HOME": self.profile.name})
        try:
            self.address = f"http://127.0.0.1:{self.port()}"
            options = {"binary": "/usr/bin/chromium",
                       "args": [*FLAGS, f"--window-size={width},{height}", f"--user-data-dir={self.profile.name}/chromium"]}
            wanted = {"browserName": "chrome", "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
            made = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
            self.session = f"/session/{made['sessionId']}"
        except BaseException:
            self.end()
            raise

    def port(self):
        for line in self.driver.stdout:
            if "started successfully on port" in line:
                return int(line.split("port")[1].strip(" .\n"))
        raise RuntimeError("chromedriver did not start")

    def call(self, method, path, body=None):
        data = json.dumps(body).encode() if body is not None else None
        request = urllib.request.Request(self.address + path, data, {"Content-Type": "application/json"}, method=method)
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        try:
            with opener.open(request, timeout=90) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as problem:
            raise RuntimeError(problem.read().decode()) from problem

    def open(self, path):
        self.call("POST", self.session + "/url", {"url": pathlib.Path(path).resolve().as_uri()})

    def run(self, script, *arguments):
        """What the body of a function in JavaScript returns."""
        return self.call("POST", self.session + "/execute/sync", {"script": script, "args": list(arguments)})

    def wait(self, expression, seconds=60):
        """Until the expression in JavaScript is true."""
        end = time.monotonic() + seconds
        while not (value := self.run(f"return {expression}")):
            if time.monotonic() > end:
                raise TimeoutError(expression)
            time.sleep(0.1)
        return value

    def drag(self, selector, start, end):
        """With the left button, from one place of an element to another, in parts of its width and height."""
        box = self.run("const b = document.querySelector(arguments[0]).getBoundingClientRect();"
                       "return [b.left, b.top, b.width, b.height]", selector)
        places = [[round(box[0] + x * box[2]), round(box[1] + y * box[3])] for x, y in (start, end)]
        move = [{"type": "pointerMove", "duration": 0, "x": x, "y": y} for x, y in places]
        self.call("POST", self.session + "/actions", {"actions": [
            {"type": "pointer", "id": "mouse", "actions": [move[0], {"type": "pointerDown", "button": 0}, move[1],
                                                           {"type": "pointerUp", "button": 0}]}]})
        self.settle()

    def settle(self):
        """Until what was asked for has been drawn."""
        self.call("POST", self.session + "/execute/async", {
            "script": "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))", "args": []})

    def log(self):
        """What the browser complained of."""
        return [entry["message"] for entry in self.call("POST", self.session + "/se/log", {"type": "browser"})]

    def picture(self):
        """The window as the bytes of a PNG."""
        return base64.b64decode(self.call("GET", self.session + "/screenshot"))

    def end(self):
        if getattr(self, "session", None):
            try:
                self.call("DELETE", self.session)
            except (OSError, RuntimeError):
                pass
        self.driver.terminate()
        self.driver.wait(20)
        self.driver.stdout.close()
        self.profile.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()
