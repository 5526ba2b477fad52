//! Arguments of C: structures whose first field is their size, texts and arrays.

use std::ffi::{CStr, c_char};
use std::ptr;

use crate::status::Failure;

/// A structure whose first field, `size: u32`, is its size in the caller's header.
///
/// Fields are only ever added at the end. Zero means the default for each of them. So a structure
/// of an older header is read as if its missing fields were zero, and one of a newer header is
/// refused only if it uses fields that this library does not know.
pub(crate) trait Versioned: Copy {
    /// Name in the header.
    const NAME: &'static str;
    /// Size in the first version of the header. Whoever adds a field sets it to the size before.
    const LEAST: usize = size_of::<Self>();
}

/// Reads the size of a structure, and checks it.
///
/// # Safety
/// `from` is null, or points to a `u32`.
unsafe fn size_of_given<T: Versioned>(field: &'static str, from: *const T) -> Result<usize, Failure> {
    if from.is_null() {
        return Err(Failure::Null(field));
    }
    // SAFETY: the caller vouches for `from`, and a packed structure may be anywhere.
    let got = unsafe { from.cast::<u32>().read_unaligned() };
    let size = got as usize;
    if size < T::LEAST || size > 1 << 16 {
        return Err(Failure::Size {
            field: "size",
            name: T::NAME,
            got,
            allowed: size_of::<T>(),
        });
    }
    Ok(size)
}

/// Reads a structure. Fields that the caller's header does not have are zero.
///
/// # Safety
/// `from` is null, or points to as many bytes as its first field says. All zeros are a valid `T`.
pub(crate) unsafe fn read<T: Versioned>(field: &'static str, from: *const T) -> Result<T, Failure> {
    // SAFETY: the caller vouches for `from`.
    let size = unsafe { size_of_given(field, from) }?;
    let known = size.min(size_of::<T>());
    let bytes = from.cast::<u8>();
    // SAFETY: the caller vouches for `size` bytes.
    let mut beyond = (known..size).map(|at| unsafe { bytes.add(at).read() });
    if beyond.any(|byte| byte != 0) {
        return Err(Failure::Newer { name: T::NAME });
    }
    // SAFETY: zeros are valid, and `known` bytes can be read and written.
    unsafe {
        let mut value = std::mem::zeroed::<T>();
        ptr::copy_nonoverlapping(bytes, ptr::from_mut(&mut value).cast::<u8>(), known);
        Ok(value)
    }
}

/// Writes a structure, except its size. Fields that this library does not know become zero.
///
/// # Safety
/// `to` is null, or points to as many bytes as its first field says.
pub(crate) unsafe fn write<T: Versioned>(field: &'static str, to: *mut T, value: T) -> Result<(), Failure> {
    // SAFETY: the caller vouches for `to`.
    let size = unsafe { size_of_given(field, to) }?;
    let known = size.min(size_of::<T>());
    let from = ptr::from_ref(&value).cast::<u8>();
    let head = size_of::<u32>();
    // SAFETY: the caller vouches for `size` bytes, and `value` has at least `known`.
    unsafe {
        ptr::copy_nonoverlapping(from.add(head), to.cast::<u8>().add(head), known - head);
        ptr::write_bytes(to.cast::<u8>().add(known), 0, size - known);
    }
    Ok(())
}

/// Checks that `to` can be written. The call has no effect yet, so that none is lost.
///
/// # Safety
/// As [`write`].
pub(crate) unsafe fn check<T: Versioned>(field: &'static str, to: *const T) -> Result<(), Failure> {
    // SAFETY: the caller vouches for `to`.
    unsafe { size_of_given(field, to) }.map(drop)
}

/// A text. Null is the empty one.
///
/// # Safety
/// `from` is null, or points to a text that ends with NUL.
pub(crate) unsafe fn text(field: &'static str, from: *const c_char) -> Result<String, Failure> {
    if from.is_null() {
        return Ok(String::new());
    }
    // SAFETY: the caller vouches for `from`.
    let text = unsafe { CStr::from_ptr(from) };
    let text = text.to_str().map_err(|_| Failure::Utf8(field))?;
    Ok(text.to_owned())
}

/// A text that is not empty. Null stands for none.
///
/// # Safety
/// As [`text`].
pub(crate) unsafe fn given(field: &'static str, from: *const c_char) -> Result<Option<String>, Failure> {
    // SAFETY: the caller vouches for `from`.
    let text = unsafe { text(field, from) }?;
    Ok(Some(text).filter(|text| !text.is_empty()))
}

/// An array of structures, of which each has `stride` bytes in the caller's header: the size that
/// each would name itself.
///
/// # Safety
/// `from` is null, or points to `count` structures of `stride` bytes. All zeros are a valid `T`.
pub(crate) unsafe fn array<T: Copy>(
    (field, from): (&'static str, *const T),
    (of_stride, stride): (&'static str, u32),
    count: (&'static str, u32, u32, u32),
) -> Result<Vec<T>, Failure> {
    let (of_count, count, least, most) = count;
    if !(least..=most).contains(&count) {
        return Err(Failure::Range {
            field: of_count,
            got: count.to_string(),
            allowed: format!("{least} to {most}"),
        });
    }
    if from.is_null() {
        return Err(Failure::Null(field));
    }
    let step = stride as usize;
    if step < size_of::<T>() || step > 1 << 16 {
        return Err(Failure::Range {
            field: of_stride,
            got: stride.to_string(),
            allowed: format!("{}, the size of one in this library's header", size_of::<T>()),
        });
    }
    let each = (0..count as usize).map(|nth| {
        // SAFETY: the caller vouches for the array.
        unsafe { from.cast::<u8>().add(nth * step).cast::<T>().read_unaligned() }
    });
    Ok(each.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Two {
        size: u32,
        first: u32,
        second: u32,
    }

    impl Versioned for Two {
        const NAME: &'static str = "Two";
        const LEAST: usize = 8;
    }

    #[repr(C)]
    #[derive(Clone, Copy)]
    struct Larger {
        two: Two,
        third: u32,
    }

    fn larger(third: u32) -> Larger {
        let two = Two {
            size: 16,
            first: 1,
            second: 2,
        };
        Larger { two, third }
    }

    #[test]
    fn an_older_structure_lacks_its_last_fields() {
        let old = Two {
            size: 8,
            first: 1,
            second: 99,
        };
        let read = unsafe { read("of", &raw const old) }.unwrap();
        assert_eq!((read.first, read.second), (1, 0));
        let mut out = old;
        unsafe {
            write(
                "of",
                &raw mut out,
                Two {
                    size: 0,
                    first: 5,
                    second: 6,
                },
            )
        }
        .unwrap();
        assert_eq!(
            (out.size, out.first, out.second),
            (8, 5, 99),
            "what it has not is not written"
        );
    }

    #[test]
    fn a_newer_structure_may_not_use_its_new_fields() {
        let new = larger(0);
        let whole: *const Larger = &raw const new;
        assert_eq!(unsafe { read("of", whole.cast::<Two>()) }.unwrap().second, 2);
        let uses = larger(3);
        let whole: *const Larger = &raw const uses;
        let failure = unsafe { read("of", whole.cast::<Two>()) }.unwrap_err();
        assert!(failure.to_string().contains("take a newer library"), "{failure}");
        let mut out = larger(3);
        let whole: *mut Larger = &raw mut out;
        unsafe {
            write(
                "of",
                whole.cast::<Two>(),
                Two {
                    size: 0,
                    first: 7,
                    second: 8,
                },
            )
        }
        .unwrap();
        assert_eq!((out.two.first, out.two.second, out.third), (7, 8, 0));
    }

    #[test]
    fn a_wrong_size_is_named() {
        for size in [0, 7, 1 << 20] {
            let of = Two {
                size,
                first: 0,
                second: 0,
            };
            let failure = unsafe { read("of", &raw const of) }.unwrap_err().to_string();
            assert!(
                failure.contains("set it to sizeof(Two), which is 12"),
                "{failure}"
            );
        }
        assert!(unsafe { read::<Two>("of", ptr::null()) }.is_err());
    }

    #[test]
    fn texts_and_arrays_are_checked() {
        assert_eq!(unsafe { text("of", ptr::null()) }.unwrap(), "");
        assert_eq!(unsafe { given("of", c"".as_ptr()) }.unwrap(), None);
        let broken = b"\xff\0";
        assert!(unsafe { text("of", broken.as_ptr().cast()) }.is_err());
        let numbers = [1_u32, 9, 2, 9];
        let of = |count, stride| unsafe {
            array(
                ("numbers", numbers.as_ptr()),
                ("number_size", stride),
                ("number_count", count, 1, 2),
            )
        };
        assert_eq!(of(2, 8).unwrap(), [1, 2], "the stride is the caller's");
        assert!(of(0, 8).is_err() && of(3, 8).is_err() && of(2, 3).is_err());
    }
}
