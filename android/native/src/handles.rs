//! Tables of what Java holds by number.

use crate::error::{Failure, Outcome};
use arc_swap::ArcSwapOption;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

/// Objects by number. Numbers are never used twice, so a closed object's number finds nothing, for
/// ever.
///
/// Looking one up takes no lock: opening and closing replace the whole table.
pub(crate) struct Table<T> {
    /// What the objects are called in messages.
    what: &'static str,
    next: AtomicI64,
    by_number: ArcSwapOption<HashMap<i64, Arc<T>>>,
}

impl<T> Table<T> {
    pub(crate) const fn new(what: &'static str) -> Self {
        Self { what, next: AtomicI64::new(1), by_number: ArcSwapOption::const_empty() }
    }

    /// Replaces the table by a copy that `change` changed; returns the one before.
    fn replace(&self, change: impl Fn(&mut HashMap<i64, Arc<T>>)) -> Option<Arc<HashMap<i64, Arc<T>>>> {
        self.by_number.rcu(|old| {
            let mut copy = old.as_deref().cloned().unwrap_or_default();
            change(&mut copy);
            Some(Arc::new(copy))
        })
    }

    /// Takes an object in; its number is above 0.
    pub(crate) fn insert(&self, object: Arc<T>) -> i64 {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        self.replace(|table| _ = table.insert(number, Arc::clone(&object)));
        number
    }

    /// The object of a number; it lives at least as long as what is returned, whoever closes it
    /// meanwhile.
    pub(crate) fn get(&self, number: i64) -> Outcome<Arc<T>> {
        let found = self.by_number.load().as_ref().and_then(|table| table.get(&number).cloned());
        found.ok_or_else(|| Failure::State(format!("this {} is closed", self.what)))
    }

    /// Forgets an object; false if there is none of that number. It is dropped here, unless it is
    /// in use.
    pub(crate) fn remove(&self, number: i64) -> bool {
        self.replace(|table| _ = table.remove(&number)).is_some_and(|before| before.contains_key(&number))
    }

    /// Objects that are open.
    pub(crate) fn len(&self) -> usize {
        self.by_number.load().as_ref().map_or(0, |table| table.len())
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
