//! What is kept in memory up to a size: when there is no room for more, all of it goes.

use std::borrow::Borrow;
use std::collections::HashMap;
use std::hash::Hash;

/// Values by key, of a number of bytes at most.
pub(super) struct Bounded<K, V> {
    most: usize,
    bytes: usize,
    /// With the size of each.
    values: HashMap<K, (V, usize)>,
}

impl<K: Eq + Hash, V> Bounded<K, V> {
    /// * `most`: what is kept at a time, bytes.
    pub(super) fn new(most: usize) -> Self {
        Self { most, bytes: 0, values: HashMap::new() }
    }

    pub(super) fn get<Q: Eq + Hash + ?Sized>(&self, key: &Q) -> Option<&V>
    where
        K: Borrow<Q>,
    {
        self.values.get(key).map(|(value, _)| value)
    }

    /// Keeps a value in place of an earlier one of the same key; one that is larger than
    /// all that may be kept is not.
    ///
    /// * `bytes`: about what key and value take in memory.
    pub(super) fn keep(&mut self, key: K, value: V, bytes: usize) {
        if bytes > self.most {
            return;
        }
        if self.bytes + bytes > self.most {
            self.clear();
        }
        self.bytes += bytes;
        if let Some((_, before)) = self.values.insert(key, (value, bytes)) {
            self.bytes -= before;
        }
    }

    pub(super) fn clear(&mut self) {
        (self.bytes, self.values) = (0, HashMap::new());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_bounded() {
        let mut kept = Bounded::new(100);
        for key in 0..1000_u32 {
            kept.keep(key, key, 30);
            // Two may have made the same one at once.
            kept.keep(key, key, 30);
            assert_eq!(kept.get(&key), Some(&key));
            assert_eq!(kept.bytes, 30 * kept.values.len());
            assert!(kept.bytes <= 100);
        }
        assert_eq!(kept.get(&0), None, "it made room");
        kept.keep(1000, 1000, 101);
        assert_eq!(kept.get(&1000), None, "too large");
        assert_eq!(kept.get(&999), Some(&999), "and nothing went for it");
        kept.clear();
        assert_eq!((kept.get(&999), kept.bytes), (None, 0));
    }
}
