//! Progress on stderr: a line that renews itself on a terminal, a few plain lines elsewhere.

use std::io::{IsTerminal, Write};
use std::time::Duration;
use visavis::FPS;
use visavis_tools::offline::Progress;

/// Shortest time between two updates on a terminal.
const INTERVAL: Duration = Duration::from_millis(100);
/// Plain lines that a run prints elsewhere.
const LINES: usize = 5;
/// Characters of the bar.
const WIDTH: usize = 30;

/// Shows how far a run has come.
pub struct ProgressLine {
    terminal: bool,
    shown: Duration,
    lines: usize,
}

impl ProgressLine {
    pub fn new() -> Self {
        Self { terminal: std::io::stderr().is_terminal(), shown: Duration::ZERO, lines: 0 }
    }

    /// Shows `progress`, if it is time to.
    pub fn show(&mut self, progress: Progress) {
        // Progress that cannot be shown is not worth an error.
        if self.terminal {
            if progress.elapsed - self.shown < INTERVAL && progress.frames < progress.total {
                return;
            }
            self.shown = progress.elapsed;
            let filled = WIDTH * progress.frames / progress.total.max(1);
            let _ = write!(std::io::stderr(), "\r[{:<WIDTH$}] {}\x1b[K", "#".repeat(filled), text(progress));
        } else if progress.frames * LINES >= (self.lines + 1) * progress.total {
            self.lines = progress.frames * LINES / progress.total.max(1);
            let _ = writeln!(std::io::stderr(), "{}", text(progress));
        }
    }

    /// Makes room for what is printed next.
    pub fn finish(&self) {
        if self.terminal {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

fn text(progress: Progress) -> String {
    let seconds = |frames: usize| frames as f64 / f64::from(FPS);
    let rate = progress.frames as f64 / progress.elapsed.as_secs_f64().max(1e-9);
    format!("{:.1} of {:.1} s, {rate:.0} frames/s", seconds(progress.frames), seconds(progress.total))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_gives_motion_time_and_rate() {
        let progress = Progress { frames: 60, total: 900, elapsed: Duration::from_millis(500) };
        assert_eq!(text(progress), "2.0 of 30.0 s, 120 frames/s");
    }
}
