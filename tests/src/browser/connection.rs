//! The DevTools protocol over one WebSocket: commands with answers, and events in between.

use anyhow::{Context, bail};
use serde_json::{Value, json};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// Longest wait for an answer: a software adapter may be busy for seconds.
const PATIENCE: Duration = Duration::from_secs(90);

/// A connection to a browser.
pub struct Connection {
    socket: WebSocket<TcpStream>,
    next: u64,
    /// Session of the tab that commands go to.
    session: Option<String>,
    /// Events that came and were not taken yet.
    events: Vec<Value>,
}

impl Connection {
    /// Connects to `HOST:PORT/path`.
    pub fn to(endpoint: &str) -> anyhow::Result<Self> {
        let (address, _) = endpoint.split_once('/').context("a DevTools address has a path")?;
        let stream = TcpStream::connect(address).with_context(|| format!("cannot reach {address}"))?;
        stream.set_read_timeout(Some(Duration::from_millis(200)))?;
        stream.set_nodelay(true)?;
        // The handshake wants a stream that waits; the timeout only cuts the waiting for messages.
        let (socket, _) = handshake(&format!("ws://{endpoint}"), stream)?;
        Ok(Self { socket, next: 0, session: None, events: Vec::new() })
    }

    /// Opens a tab; later commands go to it.
    pub fn attach_to_new_tab(&mut self) -> anyhow::Result<()> {
        let target = self.send("Target.createTarget", json!({ "url": "about:blank" }))?;
        let attached =
            self.send("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }))?;
        self.session = Some(attached["sessionId"].as_str().context("a session")?.to_owned());
        Ok(())
    }

    /// Sends a command to the tab (to the browser, before there is one) and gives its result.
    pub fn send(&mut self, method: &str, parameters: Value) -> anyhow::Result<Value> {
        let mut command = json!({ "method": method, "params": parameters });
        if let Some(session) = &self.session {
            command["sessionId"] = json!(session);
        }
        self.ask(method, command)
    }

    /// Sends a command that is the browser's, not the tab's.
    pub fn send_to_browser(&mut self, method: &str, parameters: Value) -> anyhow::Result<Value> {
        self.ask(method, json!({ "method": method, "params": parameters }))
    }

    fn ask(&mut self, method: &str, mut command: Value) -> anyhow::Result<Value> {
        self.next += 1;
        let id = self.next;
        command["id"] = json!(id);
        self.socket.send(Message::text(command.to_string()))?;
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            let Some(message) = self.receive()? else { continue };
            if message["id"] == json!(id) {
                if let Some(error) = message.get("error") {
                    bail!("{method}: {error}");
                }
                return Ok(message["result"].clone());
            }
            self.events.push(message);
        }
        bail!("{method}: no answer in {} s", PATIENCE.as_secs())
    }

    /// Takes the events that have come so far.
    pub fn take_events(&mut self) -> anyhow::Result<Vec<Value>> {
        // Whatever is in the pipe comes before the answer to any command.
        self.send("Runtime.evaluate", json!({ "expression": "0" }))?;
        Ok(std::mem::take(&mut self.events))
    }

    /// The next message, or `None` where none came in a short while.
    fn receive(&mut self) -> anyhow::Result<Option<Value>> {
        match self.socket.read() {
            Ok(Message::Text(text)) => Ok(Some(serde_json::from_str(text.as_str())?)),
            Ok(Message::Close(_)) => bail!("the browser closed the connection"),
            Ok(_) => Ok(None),
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                Ok(None)
            }
            Err(error) => Err(error).context("the browser's connection broke"),
        }
    }
}

/// The WebSocket handshake, carried on where the read timeout interrupts it.
fn handshake(
    url: &str,
    stream: TcpStream,
) -> anyhow::Result<(WebSocket<TcpStream>, tungstenite::handshake::client::Response)> {
    let mut attempt = tungstenite::client(url, stream);
    let start = Instant::now();
    loop {
        match attempt {
            Ok(done) => return Ok(done),
            Err(tungstenite::HandshakeError::Interrupted(middle)) if start.elapsed() < PATIENCE => {
                attempt = middle.handshake();
            }
            Err(error) => bail!("DevTools handshake: {error}"),
        }
    }
}
