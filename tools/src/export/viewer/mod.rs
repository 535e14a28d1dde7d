//! The viewer: one self-contained HTML file that plays a recording.
//!
//! The page (`page/`: markup, style, scripts by job) and the stage that it shares with the live page
//! (`stage/`: body, face, shaders, renderers) are compiled in; [`render`] joins it with the
//! recording's data. The file needs no network and no library, opens from disk, and forbids itself
//! any connection (Content-Security-Policy). Without WebGL 2 it draws on a 2-D canvas. Options
//! after `#` in its address, joined by `&`, make views repeatable: `t=12.3` (seconds), `play`,
//! `speed=0.5`, `cam=yaw,pitch,distance[,height]` (degrees, degrees, metres, metres; yaw 0 stands
//! on the +Z side, where a session's agent looks), `view=user`, `follow=0`, `loop=0`,
//! `theme=dark|light`, `joints`, `clean` (no panels), `fallback` (2-D canvas); where the recording
//! tells whom the body follows, `whom=0` (not coloured), `joint=NAME` (its share, and its curve).

mod data;

use crate::export::write_atomically;
use crate::recording::Recording;
use std::path::Path;
use visavis::Result;

/// What the page says about a recording, beside its data.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Meta {
    /// Title, plain text.
    pub title: String,
    /// One line under the title, plain text; may be empty.
    pub subtitle: String,
    /// Facts for the "about" panel as (name, value), plain text: model, sampler, seed, kernels,
    /// licence and so on.
    pub facts: Vec<(String, String)>,
    /// What made the motion, where it is not the frames' sampler; plain text.
    pub method: Option<String>,
    /// Relative address of the live page, where it lies beside the recording.
    pub live: Option<String>,
}

const PAGE: &str = include_str!("page/viewer.html");
const STYLE: &str = include_str!("page/viewer.css");
/// Scripts in the order in which they are joined into one function scope.
const SCRIPTS: [&str; 18] = [
    include_str!("stage/math.js"),
    include_str!("stage/shapes.js"),
    include_str!("stage/pose.js"),
    include_str!("stage/face.js"),
    include_str!("stage/mesh.js"),
    include_str!("stage/looks.js"),
    include_str!("stage/shaders.js"),
    include_str!("stage/lines.js"),
    include_str!("stage/webgl.js"),
    include_str!("stage/canvas2d.js"),
    include_str!("page/data.js"),
    include_str!("page/trail.js"),
    include_str!("page/camera.js"),
    include_str!("page/audio.js"),
    include_str!("page/whom.js"),
    include_str!("page/timeline.js"),
    include_str!("page/hud.js"),
    include_str!("page/main.js"),
];

/// The page for a recording: UTF-8 HTML, to be written to a file as it is.
///
/// Motion takes about 0.4 kB per frame and each voice 32 kB per second (16 bit at 12 kHz, base64):
/// under 3 MB for half a minute.
pub fn render(recording: &Recording, meta: &Meta) -> String {
    let script = format!("(() => {{\n\"use strict\";\n{}\n}})();", SCRIPTS.join("\n"));
    let data = data::json(recording, meta);
    let title = escape_html(&meta.title);
    let link = |address: &String| format!("<a id=\"live\" href=\"{}\">Meet it live</a>", escape_html(address));
    let live = meta.live.as_ref().map(link).unwrap_or_default();
    fill(PAGE, &[("title", &title), ("live", &live), ("style", STYLE), ("script", &script), ("data", &data)])
}

/// Writes [`render`]'s page to `path`; the file appears whole or not at all.
///
/// # Errors
/// Those of [`write_atomically`]: [`Io`](visavis::ErrorKind::Io) naming `path` when it cannot be
/// written.
pub fn write(path: impl AsRef<Path>, recording: &Recording, meta: &Meta) -> Result<()> {
    write_atomically(path, |out| out.write_all(render(recording, meta).as_bytes()))
}

/// `template` with each `{{name}}` replaced, in one pass: what is put in is not searched again.
fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut out = String::with_capacity(template.len() + values.iter().map(|(_, v)| v.len()).sum::<usize>());
    let mut rest = template;
    while let Some(start) = rest.find("{{") {
        let (before, after) = rest.split_at(start);
        out.push_str(before);
        let hit =
            values.iter().find_map(|(name, value)| Some((value, after[2..].strip_prefix(name)?.strip_prefix("}}")?)));
        rest = if let Some((value, tail)) = hit {
            out.push_str(value);
            tail
        } else {
            out.push_str("{{");
            &after[2..]
        };
    }
    out + rest
}

fn escape_html(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filling_is_one_pass_and_leaves_unknown_names() {
        let values = [("a", "{{b}}"), ("b", "2")];
        assert_eq!(fill("{{a}}-{{b}}-{{c}}-{{", &values), "{{b}}-2-{{c}}-{{");
    }

    #[test]
    fn html_is_escaped() {
        assert_eq!(escape_html(r#"<a b="c">&'"#), "&lt;a b=&quot;c&quot;&gt;&amp;&#39;");
    }

    #[test]
    fn scripts_cannot_end_their_element() {
        for script in SCRIPTS {
            assert!(!script.to_ascii_lowercase().contains("</script"));
            assert!(!script.contains("<!--"));
        }
        assert!(!STYLE.to_ascii_lowercase().contains("</style"));
    }

    #[test]
    fn the_page_connects_to_nothing() {
        let page = PAGE.to_owned() + STYLE + &SCRIPTS.concat();
        for word in ["http:", "https:", "fetch(", "XMLHttpRequest", "WebSocket", "import(", "@import", "sendBeacon"] {
            assert!(!page.contains(word), "{word}");
        }
        assert!(PAGE.contains("default-src 'none'"));
    }
}
