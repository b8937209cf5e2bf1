//! Memory in large pages.

use std::ops::Deref;

use bytemuck::Pod;
use memmap2::{Mmap, MmapMut};

/// What fills at least one large page is worth moving there.
const LARGE_PAGE: usize = 2 << 20;

/// A list that nothing changes any more, in large pages where the system has them and the list is long: rays jump about
/// in a hierarchy, and finding out where pages of 4 KB lie takes as long as the memory itself.
#[derive(Debug)]
pub struct Pages<T>(Place<T>);

#[derive(Debug)]
enum Place<T> {
    Owned(Vec<T>),
    /// As many bytes as the elements have.
    Mapped(Mmap),
}

impl<T: Pod> Pages<T> {
    /// Moves the elements, if that helps and succeeds.
    pub fn new(elements: Vec<T>) -> Self {
        let mapped = if size_of_val(&elements[..]) < LARGE_PAGE { None } else { mapped(&elements) };
        Self(mapped.map_or(Place::Owned(elements), Place::Mapped))
    }
}

/// A copy of the elements in large pages.
fn mapped<T: Pod>(elements: &[T]) -> Option<Mmap> {
    let bytes: &[u8] = bytemuck::cast_slice(elements);
    let mut map = MmapMut::map_anon(bytes.len()).ok()?;
    #[cfg(target_os = "linux")]
    map.advise(memmap2::Advice::HugePage).ok()?;
    map.copy_from_slice(bytes);
    map.make_read_only().ok()
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Place::Owned(elements) => elements,
            Place::Mapped(map) => bytemuck::cast_slice(map),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_short_lists_stay_what_they_are() {
        for length in [0, 1, 1000, LARGE_PAGE / 4 + 17] {
            let list: Vec<u32> = (0..length as u32).collect();
            let pages = Pages::new(list.clone());
            assert_eq!(*pages, *list);
            assert_eq!(matches!(pages.0, Place::Mapped(_)), length > LARGE_PAGE / 4);
        }
    }
}
