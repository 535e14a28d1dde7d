//! A document of headings, text, tables and pictures, as Markdown and as one HTML page.

use std::fmt::Write;

/// A part of a document.
pub(super) enum Piece {
    Heading(usize, String),
    Text(String),
    Table(Vec<String>, Vec<Vec<String>>),
    /// An SVG image and what it shows; Markdown has the words alone.
    Picture(String, String),
}

/// A document under construction.
#[derive(Default)]
pub(super) struct Document(Vec<Piece>);

impl Document {
    pub(super) fn heading(&mut self, level: usize, text: impl Into<String>) {
        self.0.push(Piece::Heading(level, text.into()));
    }

    pub(super) fn text(&mut self, text: impl Into<String>) {
        self.0.push(Piece::Text(text.into()));
    }

    pub(super) fn table(&mut self, head: &[&str], rows: Vec<Vec<String>>) {
        self.0.push(Piece::Table(head.iter().map(|h| (*h).to_owned()).collect(), rows));
    }

    pub(super) fn picture(&mut self, svg: String, shows: impl Into<String>) {
        self.0.push(Piece::Picture(svg, shows.into()));
    }

    pub(super) fn markdown(&self) -> String {
        let mut out = String::new();
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | ").replace('\n', " "));
        for piece in &self.0 {
            match piece {
                Piece::Heading(level, text) => out += &format!("{} {text}\n\n", "#".repeat(*level)),
                Piece::Text(text) => out += &format!("{text}\n\n"),
                Piece::Table(head, rows) => {
                    out += &line(head);
                    out += &format!("|{}\n", "---|".repeat(head.len()));
                    rows.iter().for_each(|row| out += &line(row));
                    out.push('\n');
                }
                Piece::Picture(_, shows) => out += &format!("*({shows}: picture in report.html)*\n\n"),
            }
        }
        out
    }

    pub(super) fn html(&self, title: &str) -> String {
        let mut out = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{}</title><style>{STYLE}</style></head><body>\n",
            escape(title)
        );
        let cells = |tag: &str, row: &[String]| -> String {
            row.iter().map(|c| format!("<{tag}>{}</{tag}>", escape(c))).collect()
        };
        for piece in &self.0 {
            // Writing to a string does not fail.
            let _ = match piece {
                Piece::Heading(level, text) => writeln!(out, "<h{level}>{}</h{level}>", escape(text)),
                Piece::Text(text) => writeln!(out, "<p>{}</p>", escape(text)),
                Piece::Table(head, rows) => {
                    let body: String = rows.iter().map(|r| format!("<tr>{}</tr>\n", cells("td", r))).collect();
                    writeln!(out, "<div><table><tr>{}</tr>\n{body}</table></div>", cells("th", head))
                }
                Piece::Picture(svg, shows) => {
                    writeln!(out, "<figure>{svg}<figcaption>{}</figcaption></figure>", escape(shows))
                }
            };
        }
        out + "</body></html>\n"
    }
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:72em;margin:2em auto;padding:0 1em;color:#222}\
div{overflow-x:auto}table{border-collapse:collapse;margin:.5em 0 1.5em}th,td{border-bottom:1px solid #ddd;padding:.2em .7em;\
text-align:right;white-space:nowrap}th:first-child,td:first-child{text-align:left}th{background:#f4f4f4}figure{margin:1em 0}\
figcaption{color:#555}svg{max-width:100%;height:auto}";

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_everything() {
        let mut d = Document::default();
        d.heading(1, "A & B");
        d.text("some <text>");
        d.table(&["x", "y"], vec![vec!["1".into(), "<2>".into()]]);
        d.picture("<svg/>".into(), "a line");
        let html = d.html("t");
        for part in ["<h1>A &amp; B</h1>", "some &lt;text&gt;", "<td>&lt;2&gt;</td>", "<svg/>", "a line"] {
            assert!(html.contains(part), "{part}: {html}");
        }
        let md = d.markdown();
        for part in ["# A & B\n", "| x | y |\n|---|---|\n| 1 | <2> |\n", "a line"] {
            assert!(md.contains(part), "{part}: {md}");
        }
    }
}
