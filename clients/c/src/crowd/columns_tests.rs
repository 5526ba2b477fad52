use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::f32::consts::FRAC_PI_2;
use std::slice;

use troupe_client::live::Contacts;

use super::*;

/// Counts what each thread allocates.
struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = COUNT.try_with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn form(as_six_d: bool) -> Form {
    Form {
        joints: 2,
        rate_hz: 60,
        as_six_d,
        positions: !as_six_d,
    }
}

fn show(columns: &mut Columns, row: usize, x: f32) {
    let turned = Quat::from_rotation_y(FRAC_PI_2);
    columns.row(
        row,
        Frame {
            root: Vec3::X * x,
            rotations: &[Quat::IDENTITY, turned],
            contacts: Contacts::default(),
            positions: &[Vec3::X * x, Vec3::Y],
            qpos: &[],
        },
    );
}

#[test]
fn columns_have_the_rows_of_each_character_in_order() {
    let mut columns = Columns::new(2, form(false));
    columns.begin(2);
    for row in 0..4 {
        show(&mut columns, row, row as f32);
    }
    columns.present[1] = 1;
    let view = columns.view();
    assert_eq!(
        (view.character_count, view.frame_count, view.joint_count),
        (2, 2, 2)
    );
    assert_eq!((view.rotation_size, view.rate_hz), (4, 60));
    let of = |at: *const f32, len| unsafe { slice::from_raw_parts(at, len) };
    let roots = of(view.root_positions, 12);
    assert_eq!(
        roots[9..],
        [3.0, 0.0, 0.0],
        "the last frame of the last character"
    );
    let rotations = of(view.rotations, 32);
    assert_eq!(rotations[..4], [0.0, 0.0, 0.0, 1.0], "x, y, z, w");
    let half = FRAC_PI_2.sin() * 0.5_f32.sqrt();
    assert!((rotations[5] - half).abs() < 1e-6 && (rotations[7] - half).abs() < 1e-6);
    assert_eq!(view.rotations as usize % 16, 0);
    assert_eq!(of(view.joint_positions, 24)[18..], [3.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!((columns.place(0), columns.place(1)), (None, Some(Vec3::X * 3.0)));
    columns.begin(1);
    assert_eq!(columns.place(1), None, "a new tick is empty");
}

#[test]
fn six_numbers_are_the_first_two_columns() {
    let mut columns = Columns::new(1, form(true));
    show(&mut columns, 0, 0.0);
    let view = columns.view();
    assert_eq!((view.rotation_size, view.joint_positions.is_null()), (6, true));
    let numbers = unsafe { slice::from_raw_parts(view.rotations, 12) };
    assert_eq!(numbers[..6], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // A quarter turn about Y takes X to -Z.
    let turned = [0.0, 0.0, -1.0, 0.0, 1.0, 0.0];
    assert!(numbers[6..].iter().zip(turned).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn the_newest_tick_wins_and_nothing_is_allocated() {
    let mut writer = Columns::new(3, form(false));
    let exchange = Exchange::new(writer.clone(), vec![Vec3::ZERO; 3]);
    let mut reader = writer.clone();
    let before = COUNT.get();
    for tick in 0..10 {
        writer.begin(1);
        (writer.tick, writer.missed) = (tick, 5);
        show(&mut writer, 0, tick as f32);
        writer.present[0] = 1;
        exchange.publish(&mut writer);
        if tick % 3 == 0 {
            assert_eq!(exchange.take(&mut reader, Duration::ZERO), Found::Newer);
            assert_eq!(reader.tick, tick);
            assert_eq!(exchange.take(&mut reader, Duration::ZERO), Found::Nothing);
        }
    }
    assert_eq!(COUNT.get(), before, "ticks and reads allocate nothing");
    // Of each three ticks two were replaced, the first of them after the first read.
    assert_eq!((reader.tick, reader.missed), (9, 5 + 6));
    assert_eq!(exchange.place(0), Some(Vec3::X * 9.0));
}

#[test]
fn the_last_tick_is_read_before_the_end() {
    let mut writer = Columns::new(1, form(false));
    let exchange = Exchange::new(writer.clone(), vec![Vec3::ZERO]);
    let mut reader = writer.clone();
    exchange.publish(&mut writer);
    exchange.end(TroupeStatus::Unreachable, "gone".to_owned());
    assert_eq!(exchange.take(&mut reader, Duration::ZERO), Found::Newer);
    let end = Found::Ended(TroupeStatus::Unreachable, "gone".to_owned());
    assert_eq!(exchange.take(&mut reader, Duration::from_secs(60)), end);
}

#[test]
fn a_reader_waits_for_a_tick() {
    let mut writer = Columns::new(1, form(false));
    let exchange = Exchange::new(writer.clone(), vec![Vec3::ZERO]);
    let mut reader = writer.clone();
    std::thread::scope(|scope| {
        scope.spawn(|| exchange.publish(&mut writer));
        assert_eq!(exchange.take(&mut reader, Duration::from_secs(60)), Found::Newer);
    });
    assert_eq!(
        exchange.take(&mut reader, Duration::from_millis(1)),
        Found::Nothing
    );
}
