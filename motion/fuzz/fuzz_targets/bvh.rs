//! Reads arbitrary bytes as BVH. Nothing may panic; what is read must survive writing and reading again, and conversion
//! to a clip and back.
#![no_main]

use libfuzzer_sys::fuzz_target;
use troupe_motion::bvh::{BvhFile, BvhOptions, BvhWriteOptions, parse, parse_bytes, write};

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = parse_bytes(bytes) else { return };
    // Numbers are written to six decimals, so it is the structure that must be the same.
    let again = parse(&write(&file)).expect("what was written is read");
    assert_eq!(again.frames(), file.frames());
    assert_eq!(again.joints().len(), file.joints().len());
    assert!(
        again
            .joints()
            .iter()
            .zip(file.joints())
            .all(|(a, b)| a.name == b.name && a.parent == b.parent)
    );
    if let Ok(clip) = file.to_clip(&BvhOptions::default())
        && let Ok(written) = BvhFile::from_clip(&clip, &BvhWriteOptions::default())
    {
        parse(&write(&written)).expect("a clip's file is read");
    }
});
