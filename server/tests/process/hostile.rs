//! Requests that mean no good, and the answers that are right: for a test and, with the clock beside it, a bench.

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

/// In place of a status: the connection was closed without a word, as is fair to what is no HTTP.
pub const CLOSED: u16 = 0;

/// The client's mistake, in words of the protocol that it speaks.
const WRONG: &[u16] = &[400];
/// There is no such thing, or its name cannot be one.
const MISSING: &[u16] = &[400, 404];
/// Longer than anything that is read.
const TOO_LONG: &[u16] = &[414, 431];
/// Nothing here is written to.
const METHOD: &[u16] = &[400, 405];
/// No HTTP at all.
const BROKEN: &[u16] = &[CLOSED, 400, 414, 431];

/// One request.
pub struct Hostile {
    /// Its beginning, for a failure's message.
    pub what: String,
    /// What is sent.
    pub bytes: Vec<u8>,
    /// Statuses that are right.
    pub right: &'static [u16],
    /// Whether the client stops sending in the middle.
    cut: bool,
}

impl Hostile {
    fn new(bytes: impl Into<Vec<u8>>, right: &'static [u16]) -> Self {
        let bytes = bytes.into();
        let what = bytes[..bytes.len().min(160)].escape_ascii().to_string();
        Self { what, bytes, right, cut: false }
    }

    fn get(target: &str, right: &'static [u16]) -> Self {
        Self::new(format!("GET {target} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"), right)
    }

    /// Sends it on a connection of its own; gives the whole answer, nothing where there is none.
    pub fn send(&self, address: &str) -> std::io::Result<Vec<u8>> {
        let mut stream = TcpStream::connect(address)?;
        stream.set_read_timeout(Some(Duration::from_secs(20)))?;
        stream.set_write_timeout(Some(Duration::from_secs(20)))?;
        // It may be answered, and the rest not read, before all is written.
        let _ = stream.write_all(&self.bytes);
        if self.cut {
            stream.shutdown(std::net::Shutdown::Write)?;
        }
        let mut answer = Vec::new();
        match stream.read_to_end(&mut answer) {
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => Err(error),
            _ => Ok(answer),
        }
    }

    /// What is wrong with an answer, or `Ok`.
    pub fn check(&self, answer: &[u8]) -> Result<(), String> {
        let status = status(answer);
        if !self.right.contains(&status) {
            return Err(format!("{}: answered {status}, {:?} would be right", self.what, self.right));
        }
        if answer.len() >= 16_384 {
            return Err(format!("{}: {} bytes of an answer", self.what, answer.len()));
        }
        let text = String::from_utf8_lossy(answer);
        let is_document = ["content-type: text/html", "xml"].iter().any(|kind| text.contains(kind));
        if is_document && text.contains("<script") || text.contains("root:x:") {
            return Err(format!("{}: its markup, or a file, came back", self.what));
        }
        Ok(())
    }
}

/// Status of an answer; [`CLOSED`] where there is none.
pub fn status(answer: &[u8]) -> u16 {
    let digits = answer.strip_prefix(b"HTTP/1.1 ").or_else(|| answer.strip_prefix(b"HTTP/1.0 "));
    digits
        .and_then(|rest| std::str::from_utf8(rest.get(..3)?).ok()?.parse().ok())
        .unwrap_or(if answer.is_empty() { CLOSED } else { 999 })
}

/// All of them: five hundred.
pub fn all() -> Vec<Hostile> {
    let mut all = Vec::new();
    sizes(&mut all);
    boxes(&mut all);
    markup(&mut all);
    many(&mut all);
    places(&mut all);
    traversal(&mut all);
    addresses(&mut all);
    long(&mut all);
    methods(&mut all);
    broken(&mut all);
    let missing = 500_usize.saturating_sub(all.len());
    noise(&mut all, missing);
    all
}

/// A good map's parameters but one.
fn map(without: &str, instead: &str) -> String {
    let good = [
        ("SERVICE", "WMS"),
        ("VERSION", "1.3.0"),
        ("REQUEST", "GetMap"),
        ("LAYERS", "texture"),
        ("STYLES", ""),
        ("CRS", "CRS:84"),
        ("BBOX", "10,46,11,47"),
        ("WIDTH", "64"),
        ("HEIGHT", "64"),
        ("FORMAT", "image/png"),
    ];
    let mut target = "/wms?".to_owned();
    for (name, value) in good.iter().filter(|(name, _)| *name != without) {
        let _ = write!(target, "{name}={value}&");
    }
    target + without + "=" + instead
}

fn sizes(all: &mut Vec<Hostile>) {
    for size in [
        "",
        "0",
        "00",
        "-1",
        "-0",
        "+64",
        "4097",
        "65536",
        "2147483648",
        "4294967295",
        "4294967296",
        "18446744073709551616",
        "99999999999999999999999999999999",
        "1e3",
        "1E2",
        "64.0",
        "64,",
        "NaN",
        "inf",
        "0x10",
        "%2064",
        "64%20",
        "64%00",
        "%D9%A6%D9%A4",
        "64;64",
        "six",
    ] {
        for side in ["WIDTH", "HEIGHT"] {
            all.push(Hostile::get(&map(side, size), WRONG));
        }
    }
}

fn boxes(all: &mut Vec<Hostile>) {
    for bounds in [
        "",
        ",,,",
        "1,2,3",
        "1,2,3,4,5",
        "a,b,c,d",
        "NaN,46,11,47",
        "10,nan,11,47",
        "10,46,NaN,47",
        "10,46,11,-nan",
        "inf,46,11,47",
        "10,46,inf,47",
        "-inf,-inf,inf,inf",
        "10,46,Infinity,47",
        "1e309,0,1,1",
        "0,0,1,1e999",
        "-1e308,-1e308,1e308,1e308",
        "11,46,10,47",
        "10,47,11,46",
        "10,46,10,47",
        "10,46,11,46",
        "0,0,0,0",
        "10;46;11;47",
        "10%2046%2011%2047",
        "10,46,11,0x2f",
        "10,46,11,47%00",
        "1e,2e,3e,4e",
        "--10,46,11,47",
        "99999,99999,999999,999999",
        "10,46,11,47,",
        ",10,46,11,47",
        "10.0.0,46,11,47",
        "(10,46,11,47)",
    ] {
        all.push(Hostile::get(&map("BBOX", bounds), WRONG));
        let old = map("BBOX", bounds)
            .replace("VERSION=1.3.0", "VERSION=1.1.1")
            .replace("CRS=CRS:84", "SRS=EPSG:4326");
        all.push(Hostile::get(&old, WRONG));
    }
    for mercator in ["-1e300,-1e300,1e300,1e300", "NaN,NaN,NaN,NaN", "0,0,1e10,1", "5,5,5,5"] {
        all.push(Hostile::get(&map("BBOX", mercator).replace("CRS:84", "EPSG:3857"), WRONG));
    }
}

fn markup(all: &mut Vec<Hostile>) {
    let values = [
        "%3Cscript%3Ealert(1)%3C/script%3E",
        "%22%3E%3Cscript%20src=//x%3E",
        "]]%3E%3C!DOCTYPE%20x%20[%3C!ENTITY%20e%20SYSTEM%20%22file:///etc/passwd%22%3E]%3E",
        "%26lt;script%26gt;",
        "'%20OR%201=1--",
        "a%0d%0aX-Injected:%20yes",
        "%00%01%02%1b[2J",
        "%ff%fe%c0%80",
        "$%7Bjndi:ldap://x/a%7D",
    ];
    let parameters = [
        "SERVICE",
        "VERSION",
        "REQUEST",
        "LAYERS",
        "STYLES",
        "CRS",
        "BBOX",
        "WIDTH",
        "FORMAT",
        "TRANSPARENT",
        "BGCOLOR",
        "EXCEPTIONS",
        "NODATA",
    ];
    for parameter in parameters {
        for value in values {
            all.push(Hostile::get(&map(parameter, value), WRONG));
        }
    }
}

/// Much of what should be little: layers, styles, parameters, commas, percent signs.
fn many(all: &mut Vec<Hostile>) {
    let list = |of: &str, count: usize| vec![of; count].join(",");
    let layers: Vec<String> = (0..500).map(|index| format!("layer{index}")).collect();
    all.push(Hostile::get(&map("LAYERS", &layers.join(",")), WRONG));
    all.push(Hostile::get(&map("LAYERS", &list("texture", 500)).replace("WIDTH=64", "WIDTH=0"), WRONG));
    all.push(Hostile::get(&map("LAYERS", &(list("texture", 499) + ",none")), WRONG));
    all.push(Hostile::get(&map("LAYERS", &list("texture", 500)).replace("STYLES=", "STYLES=a,b"), WRONG));
    all.push(Hostile::get(&map("LAYERS", &",".repeat(500)), WRONG));
    all.push(Hostile::get(&map("STYLES", &list("filled", 500)), WRONG));
    all.push(Hostile::get(&map("BBOX", &list("1", 4000)), WRONG));
    all.push(Hostile::get(&map("LAYERS", &"x".repeat(7000)), WRONG));
    all.push(Hostile::get(&map("CRS", &("EPSG:".to_owned() + &"9".repeat(7000))), WRONG));
    all.push(Hostile::get(&map("WIDTH", &"9".repeat(7000)), WRONG));
    let different: String = (0..1500).map(|index| format!("a{index}&")).collect();
    all.push(Hostile::get(&format!("/wms?{different}"), WRONG));
    all.push(Hostile::get(&format!("/wms?{}", "x&".repeat(4000)), WRONG));
    all.push(Hostile::get(&format!("/wms?{}", "%3D".repeat(2700)), WRONG));
    all.push(Hostile::get(&format!("/wms?{}", "=".repeat(8000)), WRONG));
    all.push(Hostile::get("/wms?REQUEST=GetMap&request=GetCapabilities", WRONG));
    all.push(Hostile::get(&format!("/tiles/{}/WebMercatorQuad/0/0/0", "x".repeat(7000)), MISSING));
}

fn places(all: &mut Vec<Hostile>) {
    let info = map("REQUEST", "GetFeatureInfo") + "&QUERY_LAYERS=texture&I=1&J=1";
    for (from, to) in [
        ("I=1", "I=-1"),
        ("I=1", "I=64"),
        ("I=1", "I=1e1"),
        ("I=1", "I=NaN"),
        ("I=1", "I=99999999999999999999"),
        ("I=1", "I="),
        ("J=1", "J=64"),
        ("J=1", "J=%3Cb%3E"),
        ("QUERY_LAYERS=texture", "QUERY_LAYERS=elevation"),
        ("QUERY_LAYERS=texture", "QUERY_LAYERS="),
        ("QUERY_LAYERS=texture", "QUERY_LAYERS=%3Cscript%3E"),
        ("I=1", "I=1&FEATURE_COUNT=-5"),
        ("I=1", "I=1&INFO_FORMAT=text/%3Cscript%3E"),
        ("BBOX=10,46,11,47", "BBOX=NaN,NaN,NaN,NaN"),
        ("WIDTH=64", "WIDTH=4294967297"),
    ] {
        all.push(Hostile::get(&info.replace(from, to), WRONG));
    }
    for native in [
        "T=texture&L=-1&X=0&Y=0",
        "T=texture&L=23&X=0&Y=0",
        "T=texture&L=4294967296&X=0&Y=0",
        "T=texture&L=0&X=10&Y=0",
        "T=texture&L=0&X=0&Y=5",
        "T=texture&L=0&X=0&Y=0&S=4097",
        "T=texture&L=0&X=0&Y=0&S=0",
        "T=texture&L=0&X=0&Y=0&D=NaN",
        "T=texture&L=0&X=0&Y=0&D=1e-300",
        "T=texture&L=22&X=4294967295&Y=4294967295",
        "T=%3Cscript%3E&L=0&X=0&Y=0",
        "T=texture&L=0&X=0&Y=0&F=image/gif",
    ] {
        all.push(Hostile::get(&format!("/world-wind?{native}"), WRONG));
    }
}

fn traversal(all: &mut Vec<Hostile>) {
    let steps =
        ["../", "..%2f", "%2e%2e/", "%2e%2e%2f", "..%5c", "....//", "..%252f", "%c0%ae%c0%ae/", "..;/"];
    for step in steps {
        for before in ["/", "/tiles/", "/trees/", "/tileMatrixSets/", "/wmts/1.0.0/"] {
            all.push(Hostile::get(&format!("{before}{}etc/passwd", step.repeat(8)), MISSING));
        }
    }
    for target in
        ["/etc/passwd", "//etc/passwd", "/proc/self/environ", "/.git/config", "/%2e", "/C:%5cboot.ini"]
    {
        all.push(Hostile::get(target, MISSING));
    }
}

fn addresses(all: &mut Vec<Hostile>) {
    for address in [
        "99/0/0",
        "300/0/0",
        "-1/0/0",
        "0/1/0",
        "0/0/1",
        "0/-1/0",
        "0/0/x",
        "4294967296/0/0",
        "1e1/0/0",
        "10/1024/0",
        "24/16777216/16777216",
        "0/0/0?f=gif",
        "0/0/0?f=%3Cscript%3E",
        "0/0/0?f=treeline",
        "0/0/%00",
        "0/0/%ff",
        "0/0",
        "0/0/0/0",
        "+0/0/0",
        "NaN/NaN/NaN",
    ] {
        all.push(Hostile::get(&format!("/tiles/elevation/WebMercatorQuad/{address}"), MISSING));
    }
    for wrong in [
        "SERVICE=WMTS&REQUEST=GetTile&VERSION=1.0.0",
        "SERVICE=WMTS&REQUEST=GetTile&VERSION=1.0.0&LAYER=texture&STYLE=default&TILEMATRIXSET=WebMercatorQuad&TILEMATRIX=0&TILEROW=9&TILECOL=0&FORMAT=image/png",
        "SERVICE=WMTS&REQUEST=GetTile&VERSION=1.0.0&LAYER=%3Cscript%3E&STYLE=default&TILEMATRIXSET=WebMercatorQuad&TILEMATRIX=0&TILEROW=0&TILECOL=0&FORMAT=image/png",
        "SERVICE=WMTS&REQUEST=GetTile&VERSION=1.0.0&LAYER=texture&STYLE=default&TILEMATRIXSET=WebMercatorQuad&TILEMATRIX=NaN&TILEROW=0&TILECOL=0&FORMAT=image/png",
        "SERVICE=WMTS&REQUEST=%3Cscript%3E",
        "SERVICE=WFS&REQUEST=GetCapabilities",
        "",
    ] {
        all.push(Hostile::get(&format!("/wmts?{wrong}"), MISSING));
    }
    for target in [
        "/trees/999",
        "/trees/-1",
        "/trees/%3Cscript%3E",
        "/tileMatrixSets/x",
        "/tiles/x",
        "/tiles/texture/x",
    ] {
        all.push(Hostile::get(target, MISSING));
    }
}

/// A megabyte where a line would do.
fn long(all: &mut Vec<Hostile>) {
    const MEGABYTE: usize = 1 << 20;
    for length in [8_193, 16_384, 40_000, 60_000] {
        all.push(Hostile::get(&format!("/wms?{}", "x".repeat(length)), TOO_LONG));
    }
    for part in ["x", "../", "%00", "a=b&", "/", "%3Cscript%3E"] {
        all.push(Hostile::get(&format!("/wms?{}", part.repeat(MEGABYTE / part.len())), TOO_LONG));
        all.push(Hostile::get(&format!("/{}", part.repeat(MEGABYTE / part.len())), TOO_LONG));
    }
    let of = |lines: &str| format!("GET /healthz HTTP/1.1\r\nHost: x\r\n{lines}\r\n");
    all.push(Hostile::new(of(&format!("X: {}\r\n", "x".repeat(MEGABYTE))), TOO_LONG));
    all.push(Hostile::new(of(&format!("{}: x\r\n", "X".repeat(MEGABYTE))), BROKEN));
    all.push(Hostile::new(of(&"X: y\r\n".repeat(200)), TOO_LONG));
    all.push(Hostile::new(of(&"X: y\r\n".repeat(MEGABYTE / 6)), TOO_LONG));
}

fn methods(all: &mut Vec<Hostile>) {
    for method in ["POST", "PUT", "DELETE", "PATCH", "TRACE", "PROPFIND", "get", "G"] {
        for path in ["/", "/wms?REQUEST=GetCapabilities", "/tiles/elevation/WebMercatorQuad/0/0/0"] {
            let head = format!("{method} {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n");
            all.push(Hostile::new(head.clone() + "Content-Length: 3\r\n\r\nabc", METHOD));
        }
    }
    let huge = "POST /wms HTTP/1.1\r\nHost: x\r\nContent-Length: 999999999999\r\n\r\n<xml/>";
    all.push(Hostile::new(huge, METHOD));
    all.push(Hostile::new(
        "POST /wms HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nffffffff\r\nabc",
        METHOD,
    ));
    all.push(Hostile::new(
        "CONNECT x:443 HTTP/1.1\r\nHost: x:443\r\nConnection: close\r\n\r\n",
        &[400, 404, 405],
    ));
}

fn broken(all: &mut Vec<Hostile>) {
    for line in [
        "",
        " ",
        "\r",
        "\u{1}\u{2}\u{3}",
        "GET",
        "GET /",
        "GET  / HTTP/1.1",
        "GET / HTTP/9.9",
        "GET / HTTP/1.1 x",
        "GET / http/1.1",
        "GET / HTTP/",
        "GET / HTTP/1.",
        "GET /\tHTTP/1.1",
        "/ GET HTTP/1.1",
        "GET \\ HTTP/1.1",
        "G\u{0}T / HTTP/1.1",
        "GET /\u{0} HTTP/1.1",
        "GET /<script> HTTP/1.1",
        "GET /\u{7f} HTTP/1.1",
        "PRI * HTTP/2.0\r\n\r\nSM",
        "SSH-2.0-OpenSSH_9.2",
        "{\"jsonrpc\":\"2.0\"}",
        "HELO example.org",
        "*1",
        "GET http:// HTTP/1.1",
        "GET ?x HTTP/1.1",
        "GET #x HTTP/1.1",
    ] {
        all.push(Hostile::new(format!("{line}\r\nHost: x\r\nConnection: close\r\n\r\n"), BROKEN));
    }
    // Hosts in the place of a path are read as such, and nothing is there.
    for target in ["x", "x:1", "example.org:443", "http://x/y"] {
        all.push(Hostile::get(target, MISSING));
    }
    // A TLS client that took the wrong port.
    all.push(Hostile::new(*b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", BROKEN));
    for header in [
        "Host x",
        ": x",
        "Ho st: x",
        "Host : x",
        "X: a\u{0}b",
        "Content-Length: -1",
        "Content-Length: abc",
        "Content-Length: 1\r\nContent-Length: 2",
        "Content-Length: 99999999999999999999999999",
        "Transfer-Encoding: x",
        "Transfer-Encoding: chunked, x",
    ] {
        let request = format!("GET /healthz HTTP/1.1\r\nHost: x\r\n{header}\r\nConnection: close\r\n\r\n");
        all.push(Hostile::new(request, BROKEN));
    }
    // RFC 9112, 3.2: one Host, no more and no less.
    all.push(Hostile::new("GET /healthz HTTP/1.1\r\nConnection: close\r\n\r\n", WRONG));
    all.push(Hostile::new("GET /healthz HTTP/1.1\r\nHost: a\r\nHost: b\r\nConnection: close\r\n\r\n", WRONG));
    // Cut off in the middle.
    for part in
        ["G", "GET /wms", "GET / HTTP/1.1\r\n", "GET / HTTP/1.1\r\nHost: x\r\n", "GET / HTTP/1.1\r\nHost"]
    {
        all.push(Hostile { cut: true, ..Hostile::new(part, BROKEN) });
    }
}

/// Bytes of no meaning, the same each time; the first belongs to no method.
fn noise(all: &mut Vec<Hostile>, count: usize) {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    for _ in 0..count {
        let length = 1 + next() as usize % 2000;
        let mut bytes: Vec<u8> = (0..length).map(|_| next() as u8).collect();
        bytes[0] |= 0x80;
        bytes.extend(b"\r\n\r\n");
        all.push(Hostile::new(bytes, BROKEN));
    }
}
