//! Tables of what Java holds by number.

use crate::error::{Failure, Outcome};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Objects by number. Numbers are never used twice, so a closed object's number finds nothing, for ever.
pub(crate) struct Table<T> {
    /// What the objects are called in messages.
    what: &'static str,
    entries: Mutex<Option<Entries<T>>>,
}

struct Entries<T> {
    next: i64,
    by_number: HashMap<i64, Arc<T>>,
}

impl<T> Table<T> {
    pub(crate) const fn new(what: &'static str) -> Self {
        Self { what, entries: Mutex::new(None) }
    }

    fn entries(&self) -> MutexGuard<'_, Option<Entries<T>>> {
        // Nothing that can panic runs while this is locked.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes an object in; its number is above 0.
    pub(crate) fn insert(&self, object: Arc<T>) -> i64 {
        let mut entries = self.entries();
        let entries = entries.get_or_insert_with(|| Entries { next: 1, by_number: HashMap::new() });
        let number = entries.next;
        entries.next += 1;
        entries.by_number.insert(number, object);
        number
    }

    /// The object of a number; it lives at least as long as what is returned, whoever closes it meanwhile.
    pub(crate) fn get(&self, number: i64) -> Outcome<Arc<T>> {
        let found = self.entries().as_ref().and_then(|e| e.by_number.get(&number).cloned());
        found.ok_or_else(|| Failure::State(format!("this {} is closed", self.what)))
    }

    /// Forgets an object; false if there is none of that number. It is dropped here, unless it is in use.
    pub(crate) fn remove(&self, number: i64) -> bool {
        let gone = self.entries().as_mut().and_then(|e| e.by_number.remove(&number));
        gone.is_some()
    }

    /// Objects that are open.
    pub(crate) fn len(&self) -> usize {
        self.entries().as_ref().map_or(0, |e| e.by_number.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_not_used_twice() {
        static TABLE: Table<u8> = Table::new("thing");
        let (a, b) = (TABLE.insert(Arc::new(1)), TABLE.insert(Arc::new(2)));
        assert!(a > 0 && a != b && TABLE.len() == 2);
        let held = TABLE.get(a).unwrap();
        assert!(TABLE.remove(a) && !TABLE.remove(a));
        assert_eq!(*held, 1);
        assert!(TABLE.get(a).unwrap_err().to_string().contains("closed"));
        assert_ne!(TABLE.insert(Arc::new(3)), a);
        assert!(TABLE.get(0).is_err() && TABLE.get(-1).is_err() && *TABLE.get(b).unwrap() == 2);
    }
}
