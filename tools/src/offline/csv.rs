//! User paths from CSV files: `t,x,y,z`.

use glam::{Quat, Vec3};
use std::path::Path;
use visavis::internals::user::{HOLD_SECONDS, MAX_DISTANCE};
use visavis::{Error, ErrorKind, Result};

/// Longest file that is read, bytes: a day at 120 Hz is a third of it.
const MAX_BYTES: u64 = 1 << 30;

const COLUMNS: [&str; 4] = ["t", "x", "y", "z"];

/// A recorded path of the user's head: positions at ascending times, at least one, and rotations
/// where they were recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct UserPath {
    points: Vec<(f64, Vec3)>,
    /// As many as points, or none.
    rotations: Vec<Quat>,
}

impl UserPath {
    /// Reads a CSV file: the header `t,x,y,z`, then seconds and metres (world, Y up), at any rate.
    /// Byte order mark, CRLF, blank lines and spaces around values are fine.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when the file cannot be read; [`ErrorKind::UserPath`], naming file and
    /// line, for a missing or different header, a wrong number of columns, text or NaN for a
    /// number, a time that is not later than the line before, a position beyond 1 km, or no
    /// positions at all.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = visavis::internals::bounded::read(path, MAX_BYTES)
            .map_err(|e| Error::io("read the user's path", path, e))?;
        let text = std::str::from_utf8(&bytes).map_err(|_| bad("not a text file in UTF-8; save it as CSV".into()));
        text.and_then(Self::parse).map_err(|e| e.with_path(path))
    }

    /// As [`UserPath::read`], from the text of a file.
    ///
    /// # Errors
    /// As [`UserPath::read`], without a file name.
    pub fn parse(text: &str) -> Result<Self> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
        let mut lines = lines.filter(|(_, line)| !line.is_empty());
        let (number, header) = lines.next().ok_or_else(|| bad("the file is empty; write a header `t,x,y,z`".into()))?;
        if !header.split(',').map(str::trim).eq(COLUMNS) {
            return Err(at_line(number, &format!("the header must be `t,x,y,z`, not `{}`", excerpt(header))));
        }
        let mut points: Vec<(f64, Vec3)> = Vec::new();
        for (number, line) in lines {
            let (time, position) = row(line).map_err(|what| at_line(number, &what))?;
            if let Some(&(last, _)) = points.last()
                && time <= last
            {
                let what = format!("time {time} is not later than {last} before it; sort by time, drop duplicates");
                return Err(at_line(number, &what));
            }
            points.push((time, position));
        }
        if points.is_empty() {
            return Err(bad("there are no positions below the header; add lines like `0.0,0.1,1.65,2.0`".into()));
        }
        Ok(Self { points, rotations: Vec::new() })
    }

    /// A path of positions (m) at times (s).
    ///
    /// # Errors
    /// [`ErrorKind::UserPath`] when there are none, when times do not ascend, or for a value that
    /// is not finite.
    pub fn from_points(points: Vec<(f64, Vec3)>) -> Result<Self> {
        let finite = points.iter().all(|(t, p)| t.is_finite() && p.is_finite());
        if points.is_empty() || !finite || points.windows(2).any(|w| w[1].0 <= w[0].0) {
            return Err(bad("points of a path are finite, at ascending times, and at least one".into()));
        }
        Ok(Self { points, rotations: Vec::new() })
    }

    /// The same with the head's rotation at each point.
    ///
    /// # Errors
    /// [`ErrorKind::UserPath`] when there are not as many, or one is not of unit length.
    pub fn with_rotations(self, rotations: Vec<Quat>) -> Result<Self> {
        if rotations.len() != self.points.len() || !rotations.iter().all(|r| r.is_normalized()) {
            return Err(bad("rotations of a path are of unit length, one a point".into()));
        }
        Ok(Self { rotations, ..self })
    }

    /// The head's rotations, one a point, or none at all.
    pub fn rotations(&self) -> &[Quat] {
        &self.rotations
    }

    /// Times (s) and head positions (m), ascending in time; never empty.
    pub fn points(&self) -> &[(f64, Vec3)] {
        &self.points
    }

    /// Time of the last position, seconds.
    pub fn end(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.0)
    }

    /// The head at `time` (s), linear between positions; `None` outside the path and inside gaps of
    /// more than half a second.
    ///
    /// For tools that know the whole path; a session tracks the head as it comes and does not look
    /// ahead.
    pub fn at(&self, time: f64) -> Option<Vec3> {
        let after = self.points.partition_point(|p| p.0 <= time);
        let &(t0, p0) = self.points.get(after.checked_sub(1)?)?;
        if t0 == time {
            return Some(p0);
        }
        let &(t1, p1) = self.points.get(after)?;
        (t1 - t0 <= HOLD_SECONDS).then(|| p0.lerp(p1, ((time - t0) / (t1 - t0)) as f32))
    }
}

fn row(line: &str) -> Result<(f64, Vec3), String> {
    let mut values = [0.0; 4];
    let mut count = 0;
    for text in line.split(',') {
        let text = text.trim();
        if let Some(value) = values.get_mut(count) {
            let name = COLUMNS[count];
            *value = text.parse::<f64>().map_err(|_| format!("{name} is `{}`, not a number", excerpt(text)))?;
            if !value.is_finite() {
                return Err(format!("{name} is {text}; leave out times at which the position is not known"));
            }
        }
        count += 1;
    }
    if count != values.len() {
        return Err(format!("{count} columns, not 4; write `t,x,y,z` with points as decimal marks"));
    }
    let [time, x, y, z] = values;
    let position = Vec3::new(x as f32, y as f32, z as f32);
    if x * x + y * y + z * z > f64::from(MAX_DISTANCE).powi(2) {
        return Err(format!("the position is more than {MAX_DISTANCE} m away; positions are in metres"));
    }
    Ok((time, position))
}

/// The beginning of a text that may be anything.
fn excerpt(text: &str) -> String {
    text.chars().take(40).flat_map(char::escape_debug).collect()
}

fn at_line(number: usize, what: &str) -> Error {
    bad(format!("line {number}: {what}"))
}

fn bad(message: String) -> Error {
    Error::new(ErrorKind::UserPath, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn reads_what_spreadsheets_write() {
        let points = vec![(0.0, Vec3::new(1.0, 1.6, -2.0)), (0.5, Vec3::new(2.0, 1.5, 0.0))];
        let want = UserPath { points, rotations: Vec::new() };
        for text in [
            "t,x,y,z\n0,1,1.6,-2\n0.5,2,1.5,0\n",
            "t,x,y,z\n0,1,1.6,-2\n0.5,2,1.5,0",
            "\u{feff}t,x,y,z\r\n0,1,1.6,-2\r\n\r\n5e-1,2,1.5,0\r\n\r\n",
            "\n t , x, y ,z \n 0 ,1 , 1.6,-2\n   \n\t0.5,2,1.5,0\n",
        ] {
            assert_eq!(UserPath::parse(text).unwrap(), want, "{text:?}");
        }
        assert_eq!(want.end(), 0.5);
    }

    #[test]
    fn says_what_is_wrong_and_where() {
        for (text, part) in [
            ("", "empty"),
            ("\u{feff}\r\n \n", "empty"),
            ("t,x,y,z\n", "no positions"),
            ("0,1,2,3\n", "line 1: the header"),
            ("time,x,y,z\n0,1,2,3\n", "line 1: the header"),
            ("t,x,y\n0,1,2\n", "line 1: the header"),
            ("t;x;y;z\n0;1;2;3\n", "line 1: the header"),
            ("t,x,y,z\n0,1,2\n", "line 2: 3 columns"),
            ("t,x,y,z\n0,1,2,3,4\n", "line 2: 5 columns"),
            ("t,x,y,z\n\n0,1,2,3\n1,here,2,3\n", "line 4: x is `here`"),
            ("t,x,y,z\n0,1,,3\n", "line 2: y is ``"),
            ("t,x,y,z\n0,1,NaN,3\n", "line 2: y is NaN"),
            ("t,x,y,z\ninf,1,2,3\n", "line 2: t is inf"),
            ("t,x,y,z\n0,1,2,3\n1,1,2,3\n0.5,1,2,3\n", "line 4: time 0.5"),
            ("t,x,y,z\n0,1,2,3\n0,1,2,3\n", "line 3: time 0"),
            ("t,x,y,z\n0,1,2,1000.1\n", "line 2: the position"),
            ("t,x,y,z\n0,1e300,2,3\n", "line 2: the position"),
        ] {
            let e = UserPath::parse(text).unwrap_err();
            assert_eq!(e.kind(), ErrorKind::UserPath);
            assert!(e.to_string().contains(part), "{text:?}: {e}");
        }
    }

    #[test]
    fn errors_name_the_file() {
        let e = UserPath::read("no/such.csv").unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(Path::new("no/such.csv"))));
        let e = UserPath::read("Cargo.toml").unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::UserPath, Some(Path::new("Cargo.toml"))));
    }

    #[test]
    fn gaps_stay_gaps() {
        let path = UserPath::parse("t,x,y,z\n1,0,0,0\n1.5,1,0,0\n2.1,2,0,0\n").unwrap();
        assert_eq!(path.at(0.99), None);
        assert_eq!(path.at(1.0), Some(Vec3::ZERO));
        assert_eq!(path.at(1.25), Some(Vec3::new(0.5, 0.0, 0.0)));
        assert_eq!(path.at(1.5), Some(Vec3::X));
        assert_eq!(path.at(1.75), None);
        assert_eq!(path.at(2.1), Some(Vec3::new(2.0, 0.0, 0.0)));
        assert_eq!(path.at(2.2), None);
        assert_eq!(path.at(f64::NAN), None);
    }

    proptest! {
        #[test]
        fn never_panics(text in "(t,x,y,z\n)?([0-9.,eNa\\- \n\r\u{feff}]|\\PC){0,60}") {
            if let Err(e) = UserPath::parse(&text) {
                prop_assert_eq!(e.kind(), ErrorKind::UserPath);
            }
        }
    }
}
