//! A browser that a test looks through: one process for many pages, led over a pipe by the DevTools protocol
//! (<https://chromedevtools.github.io/devtools-protocol/>): a message each way is JSON and ends with a zero byte.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use tempfile::TempDir;

/// Longest that is waited for an answer.
const PATIENCE: Duration = Duration::from_secs(120);

/// A headless Chromium.
#[derive(Debug)]
pub struct Browser {
    child: Child,
    commands: ChildStdin,
    said: Receiver<Value>,
    /// Messages that were no answers, and have not been looked at.
    events: Vec<Value>,
    last: u64,
    /// Its profile.
    _folder: TempDir,
}

/// A page in a browser, by the session that leads it.
#[derive(Debug)]
pub struct Page {
    target: String,
    session: String,
}

/// How a page is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Width and height of the window, px.
    pub window: [u32; 2],
    /// Whether the system asks for dark pages.
    pub dark: bool,
    /// Whether fingers touch it.
    pub phone: bool,
}

fn installed() -> Option<PathBuf> {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let mut places = std::env::split_paths(&paths)
        .flat_map(|folder| ["chromium", "chromium-browser", "google-chrome"].map(|name| folder.join(name)));
    places.find(|path| path.is_file())
}

impl Browser {
    /// A new browser; nothing, said loudly, where none is installed.
    ///
    /// # Panics
    /// When none is installed and `CI=true`, or it does not start.
    pub fn start() -> Option<Self> {
        let Some(program) = installed() else {
            let in_ci = std::env::var("CI").as_deref() == Ok("true");
            assert!(!in_ci, "in CI pages must be looked at: install chromium");
            eprintln!("SKIPPED: there is no chromium, so NO page is looked at; ./ci.sh test installs it");
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        // It reads commands from descriptor 3 and answers on 4.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1", "sh"])
            .arg(program)
            .args(["--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--no-first-run"])
            .args(["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
            .args(["--hide-scrollbars", "--disable-background-networking", "--disable-component-update"])
            .arg(format!("--user-data-dir={}", folder.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (commands, answers) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let (say, said) = channel();
        std::thread::spawn(move || {
            let messages = BufReader::new(answers).split(0).map_while(Result::ok);
            for message in messages.filter_map(|bytes| serde_json::from_slice(&bytes).ok()) {
                if say.send(message).is_err() {
                    break;
                }
            }
        });
        Some(Self { child, commands, said, events: Vec::new(), last: 0, _folder: folder })
    }

    /// Have something done, in a session or by the browser itself, and wait for the answer.
    fn call(&mut self, session: Option<&str>, method: &str, params: &Value) -> Value {
        self.last += 1;
        let mut command = json!({ "id": self.last, "method": method, "params": params });
        if let Some(session) = session {
            command["sessionId"] = session.into();
        }
        self.commands.write_all(format!("{command}\0").as_bytes()).unwrap();
        loop {
            let mut message = self.said.recv_timeout(PATIENCE).unwrap_or_else(|e| panic!("{method}: {e}"));
            if message["id"] == self.last {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].take();
            }
            self.events.push(message);
        }
    }

    /// Opens a page and waits until it has loaded.
    pub fn open(&mut self, address: &str, sight: Sight) -> Page {
        let made =
            self.call(None, "Target.createTarget", &json!({ "url": "about:blank", "newWindow": true }));
        let target = made["targetId"].as_str().unwrap().to_owned();
        let attach = json!({ "targetId": target, "flatten": true });
        let session =
            self.call(None, "Target.attachToTarget", &attach)["sessionId"].as_str().unwrap().to_owned();
        let page = Page { target, session };
        for domain in ["Page", "Runtime", "Log", "Network"] {
            self.lead(&page, &format!("{domain}.enable"), &json!({}));
        }
        self.see(&page, sight);
        self.events.clear();
        self.lead(&page, "Page.navigate", &json!({ "url": address }));
        let loaded = |event: &Value| event["method"] == "Page.loadEventFired";
        while !self.events.iter().any(loaded) {
            let event = self.said.recv_timeout(PATIENCE).unwrap_or_else(|e| panic!("{address}: {e}"));
            self.events.push(event);
        }
        self.settle(&page);
        page
    }

    /// The answer of a page to a command of the protocol.
    pub fn lead(&mut self, page: &Page, method: &str, params: &Value) -> Value {
        self.call(Some(&page.session), method, params)
    }

    /// Look at a page in another way.
    pub fn see(&mut self, page: &Page, sight: Sight) {
        let [width, height] = sight.window;
        let window =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": sight.phone });
        self.lead(page, "Emulation.setDeviceMetricsOverride", &window);
        let scheme = if sight.dark { "dark" } else { "light" };
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.lead(page, "Emulation.setEmulatedMedia", &media);
    }

    /// Wait until what was changed is drawn.
    pub fn settle(&mut self, page: &Page) {
        let two = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))";
        self.evaluate(page, two);
    }

    /// The value of an expression, waited for if it is a promise.
    ///
    /// # Panics
    /// When it throws.
    pub fn evaluate(&mut self, page: &Page, expression: &str) -> Value {
        let params = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let mut answer = self.lead(page, "Runtime.evaluate", &params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {answer}");
        answer["result"]["value"].take()
    }

    /// What is seen in the box of the element that a selector finds, at a scale.
    pub fn picture(&mut self, page: &Page, selector: &str, scale: f64) -> RgbImage {
        let of = format!(
            "(() => {{ const b = document.querySelector({selector:?}).getBoundingClientRect(); \
             return [b.x + scrollX, b.y + scrollY, b.width, b.height]; }})()"
        );
        let corner = self.evaluate(page, &of);
        let [x, y, width, height] = [0, 1, 2, 3].map(|k| corner[k].as_f64().unwrap());
        let clip = json!({ "x": x, "y": y, "width": width, "height": height, "scale": scale });
        let params =
            json!({ "format": "png", "clip": clip, "captureBeyondViewport": true, "optimizeForSpeed": true });
        let shot = self.lead(page, "Page.captureScreenshot", &params);
        let bytes = STANDARD.decode(shot["data"].as_str().unwrap()).unwrap();
        image::load_from_memory(&bytes).unwrap().to_rgb8()
    }

    /// What the pages have complained of since the last one was opened: errors, warnings, what was thrown. The plotting
    /// library's own remark on how it reads pixels back is none.
    pub fn complaints(&self) -> Vec<String> {
        let of = |event: &Value| {
            let params = &event["params"];
            let complains = match event["method"].as_str()? {
                "Runtime.exceptionThrown" => true,
                "Runtime.consoleAPICalled" => params["type"] == "error" || params["type"] == "warning",
                "Log.entryAdded" => {
                    params["entry"]["level"] == "error" || params["entry"]["level"] == "warning"
                }
                _ => false,
            };
            (complains && !params.to_string().contains("willReadFrequently")).then(|| params.to_string())
        };
        self.events.iter().filter_map(of).collect()
    }

    /// The addresses that were asked for since the last page was opened, but for what stands in pages themselves.
    pub fn requests(&self) -> Vec<String> {
        let of = |event: &Value| {
            let address = event["params"]["request"]["url"].as_str()?;
            let inside = address.starts_with("data:") || address.starts_with("blob:");
            (event["method"] == "Network.requestWillBeSent" && !inside).then(|| address.to_owned())
        };
        self.events.iter().filter_map(of).collect()
    }

    /// Closes a page.
    pub fn close(&mut self, page: &Page) {
        self.call(None, "Target.closeTarget", &json!({ "targetId": page.target }));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It ends with its pipe; it is waited for, so that its profile can be removed.
        let _ = self.commands.write_all(b"{\"id\":0,\"method\":\"Browser.close\"}\0");
        let _ = self.child.wait();
    }
}
