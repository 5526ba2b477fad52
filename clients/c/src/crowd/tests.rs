use std::ptr;

use super::*;

fn characters(count: u32) -> (Vec<TroupeCharacter>, TroupeCrowdOptions) {
    let one = TroupeCharacter {
        seed: 7,
        position: TroupeVec3 {
            x: 1.0,
            y: 0.0,
            z: 2.0,
        },
        heading: 0.5,
        style: c"elderly".as_ptr(),
    };
    let all = vec![one; count as usize];
    let options = TroupeCrowdOptions {
        size: size_of::<TroupeCrowdOptions>() as u32,
        clock: 0,
        rate_hz: 0,
        rotation: 0,
        joint_positions: 0,
        ttl_ms: 0,
        reconnect_ms: 0,
        character_count: count,
        character_size: size_of::<TroupeCharacter>() as u32,
        reserved: 0,
        characters: all.as_ptr(),
        scene: ptr::null(),
    };
    (all, options)
}

fn read_options(options: &TroupeCrowdOptions) -> Result<Wanted, Failure> {
    unsafe { wanted(ptr::from_ref(options)) }
}

#[test]
fn zeros_are_the_defaults() {
    let (_all, options) = characters(2);
    let wanted = read_options(&options).unwrap();
    assert!(wanted.by_server && !wanted.as_six_d && !wanted.frames.positions);
    assert_eq!(wanted.frames.rate.hz(), 30);
    assert_eq!(wanted.drive.reconnect, Some(Duration::from_secs(10)));
    assert_eq!(wanted.sessions.len(), 2);
    let place = glam::Vec3::new(1.0, 0.0, 2.0);
    let expected = troupe_client::SessionOptions::new()
        .seed(7)
        .at(place, 0.5)
        .style("elderly");
    assert_eq!(wanted.sessions[0], expected);
    assert_eq!(wanted.places, [place; 2]);
}

#[test]
fn options_that_cannot_be_used_are_named() {
    type Change = fn(&mut TroupeCrowdOptions);
    let wrong: [(Change, &str); 6] = [
        (
            |of| of.rate_hz = 40,
            "options.rate_hz is 40, but must be 30, 50 or 60",
        ),
        (
            |of| of.clock = 2,
            "options.clock is 2, but must be a TroupeClock: 0 or 1",
        ),
        (
            |of| of.rotation = 9,
            "options.rotation is 9, but must be a TroupeRotation: 0 or 1",
        ),
        (
            |of| of.character_count = 0,
            "options.character_count is 0, but must be 1 to 1024",
        ),
        (
            |of| of.characters = ptr::null(),
            "options.characters is null: give an address",
        ),
        (
            |of| of.size = 4,
            "size is 4: set it to sizeof(TroupeCrowdOptions), which is 56 in this library's header",
        ),
    ];
    for (change, message) in wrong {
        let (_all, mut options) = characters(1);
        change(&mut options);
        assert_eq!(read_options(&options).unwrap_err().to_string(), message);
    }
    let (_all, mut never) = characters(1);
    never.reconnect_ms = TROUPE_NEVER;
    assert_eq!(read_options(&never).unwrap().drive.reconnect, None);
}
