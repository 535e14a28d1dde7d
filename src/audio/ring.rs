//! A bounded queue of samples on an absolute time line.

/// Samples `start..end` of an endless line, at most as many as the capacity.
#[derive(Debug)]
pub(super) struct Ring {
    data: Vec<f32>,
    start: u64,
    end: u64,
}

impl Ring {
    pub(super) fn new(capacity: usize) -> Self {
        Self { data: vec![0.0; capacity], start: 0, end: 0 }
    }

    /// Index of the first sample that has not been taken.
    pub(super) fn start(&self) -> u64 {
        self.start
    }

    /// Index that the next pushed sample gets.
    pub(super) fn end(&self) -> u64 {
        self.end
    }

    fn at(&self, index: u64) -> usize {
        (index % self.data.len() as u64) as usize
    }

    /// Appends what fits and returns how many did not.
    pub(super) fn push(&mut self, samples: &[f32]) -> usize {
        let room = self.data.len() - (self.end - self.start) as usize;
        let take = room.min(samples.len());
        let at = self.at(self.end);
        let first = take.min(self.data.len() - at);
        self.data[at..at + first].copy_from_slice(&samples[..first]);
        self.data[..take - first].copy_from_slice(&samples[first..take]);
        self.end += take as u64;
        samples.len() - take
    }

    /// Appends up to `count` zeros and returns how many did not fit.
    pub(super) fn push_silence(&mut self, mut count: usize) -> usize {
        const ZEROS: [f32; 64] = [0.0; 64];
        while count > 0 {
            let piece = count.min(ZEROS.len());
            let over = self.push(&ZEROS[..piece]);
            count -= piece - over;
            if over > 0 {
                return count;
            }
        }
        0
    }

    /// Moves the start to `from` and takes the `out.len()` samples from there: what is missing is zero, and the line goes
    /// on after it. Returns how many are missing. `from` is at least [`Ring::start`].
    pub(super) fn take(&mut self, from: u64, out: &mut [f32]) -> usize {
        let have = self.end.saturating_sub(from).min(out.len() as u64) as usize;
        let at = self.at(from);
        let first = have.min(self.data.len() - at);
        out[..first].copy_from_slice(&self.data[at..at + first]);
        out[first..have].copy_from_slice(&self.data[..have - first]);
        out[have..].fill(0.0);
        self.start = from + out.len() as u64;
        self.end = self.end.max(self.start);
        out.len() - have
    }

    /// Drops what has not been taken.
    pub(super) fn clear(&mut self) {
        self.end = self.start;
    }

    /// Empty, at index `at`.
    pub(super) fn reset(&mut self, at: u64) {
        (self.start, self.end) = (at, at);
    }
}
