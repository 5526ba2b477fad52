//! Path files and their playing.

use std::f32::consts::FRAC_PI_2;
use std::path::Path as FilePath;

use glam::{Vec2, Vec3};
use troupe_client::{Act, Locomotion};

use super::player::Player;
use super::script::{Moment, Path};

fn parse(text: &str) -> Path {
    Path::parse(text).unwrap_or_else(|why| panic!("{why}"))
}

#[test]
fn the_paths_of_the_repository_are_read() {
    let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../examples/paths");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let file = entry.unwrap().path();
        let path = Path::read(&file).unwrap_or_else(|why| panic!("{why}"));
        assert!(path.title.is_some() && path.limit_s() > 3.0);
        let commanded = path.commanded(path.limit_s()).len();
        assert!(commanded > 2 || path.acts(), "{}", file.display());
        let watched = path.scene.is_some() || path.does_skills();
        assert_eq!(path.acts(), watched, "{}", file.display());
        names.push(file.file_stem().unwrap().to_string_lossy().into_owned());
    }
    names.sort();
    assert_eq!(
        names,
        [
            "bow",
            "cup",
            "figure-of-eight",
            "g1-crawl",
            "g1-jump",
            "g1-lie-down",
            "g1-sit-on-ground",
            "open",
            "reversal",
            "robot",
            "sit",
            "square",
            "style-changes",
            "walk"
        ]
    );
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let cases = [
        ("seed = 1\n", "neither a [[command]]"),
        ("[[command]]\nspeed = 1", "time_s"),
        ("[[command]]\ntime_s = 0\nsped = 1", "line 3"),
        ("[[command]]\ntime_s = 0\nsped = 1", "sped"),
        (
            "[[command]]\ntime_s = -1",
            "line 2: time_s is -1, but may be 0 to 3600",
        ),
        (
            "[[command]]\ntime_s = 2\n[[command]]\ntime_s = 1",
            "line 4: time_s is 1, but the command before is at 2",
        ),
        (
            "[[command]]\ntime_s = 0\nvelocity = [0, 1]\nspeed = 1",
            "line 3: velocity excludes speed",
        ),
        (
            "[[command]]\ntime_s = 0\nvelocity = [0, nan]",
            "line 3: velocity is",
        ),
        ("[[command]]\ntime_s = 0\nvelocity = [0, 1, 2]", "line 3"),
        (
            "[[command]]\ntime_s = 0\nspeed = 50",
            "line 3: speed is 50, but may be 0 to 20",
        ),
        ("[[command]]\ntime_s = 0\nfacing_deg = inf", "facing_deg is inf"),
        ("[[waypoint]]\nat = [0, 4]", "line 1: speed is missing"),
        (
            "[[waypoint]]\nat = [0, 4000]\nspeed = 1",
            "line 2: at is [0, 4000]",
        ),
        ("[[waypoint]]\nat = [0, 4]\nspeed = 0", "line 3: speed is 0"),
        (
            "[[waypoint]]\nat = [0, 4]\nspeed = 1\n[[command]]\ntime_s = 1\nspeed = 1",
            "line 4: velocity, speed and direction_deg come from the waypoints",
        ),
        (
            "[[command]]\nspeed = 1",
            "line 1: time_s is missing; or else give after or wait_s",
        ),
        (
            "[[command]]\nwait_s = 1\ntime_s = 2",
            "line 3: time_s excludes after and wait_s",
        ),
        (
            "[[command]]\ntime_s = 0\ninteract = 'cup'\n[[command]]\nafter = 'sat'",
            "line 5: after is \"sat\", but may be \"held\" or \"done\"",
        ),
        (
            "[[command]]\ntime_s = 0\nspeed = 1\n[[command]]\nafter = 'held'",
            "line 5: after waits for what an interact or a skill before it began",
        ),
        ("[[command]]\nwait_s = -1", "line 2: wait_s is -1"),
        (
            "[[command]]\ntime_s = 0\nvariant = 'deep'",
            "line 3: variant needs interact",
        ),
        (
            "[[command]]\ntime_s = 0\n\n[[command]]\ntime_s = 1\nend = true\ndrop = true",
            "line 4: interact, skill, end, cancel, drop and perform exclude each other",
        ),
        (
            "[[command]]\ntime_s = 0\ninteract = 'cup'\nspeed = 1",
            "line 1: interact, skill, end, cancel, drop and perform exclude what says how to move",
        ),
        (
            "[[command]]\ntime_s = 0\nperform = 'wave'\ncancel = true",
            "line 1: interact, skill, end, cancel, drop and perform exclude each other",
        ),
        (
            "[[command]]\ntime_s = 0\ninteract = 'cup'\nhand = 'left'",
            "line 4",
        ),
        ("[[command]]\ntime_s = 0\ninteract = 'cup'\nhand = 'left'", "hand"),
        ("seconds = 0\n[[command]]\ntime_s = 0", "line 1: seconds is 0"),
        ("start = [1]\n[[command]]\ntime_s = 0", "line 1"),
    ];
    for (text, wanted) in cases {
        let error = Path::parse(text).expect_err(text);
        assert!(error.contains(wanted), "{text:?}: {error}");
    }
}

#[test]
fn commands_keep_velocity_and_style_and_drop_the_rest() {
    let path = parse(
        "style = 'walk'\nheading_deg = 90\n\
         [[command]]\ntime_s = 0.5\nspeed = 1\nfacing_deg = 0\nheight_m = 0.7\n\
         [[command]]\ntime_s = 1\nstyle = 'old'\ngait = 'walk'\n\
         [[command]]\ntime_s = 1.5\nvelocity = [0, -2]\n\
         [[command]]\ntime_s = 2\nspeed = 1\n\
         [[command]]\ntime_s = 3\nspeed = 0\n",
    );
    let mut player = Player::new(&path);
    let mut at = |time_s| player.intent(time_s, Vec2::ZERO).unwrap().clone();
    assert_eq!(at(0.0), Locomotion::stand().style("walk"));
    // A speed alone goes in the direction that the character faces at first.
    let first = at(0.5);
    assert!(first.velocity.abs_diff_eq(Vec3::X, 1e-6), "{}", first.velocity);
    assert_eq!((first.facing, first.height), (Some(0.0), Some(0.7)));
    // A frame's time rounded down still counts.
    let second = at(0.99995);
    assert_eq!(
        (second.style.as_deref(), second.gait.as_deref()),
        (Some("old"), Some("walk"))
    );
    assert_eq!(
        (second.velocity, second.facing, second.height),
        (first.velocity, None, None)
    );
    assert!(at(1.5).velocity.abs_diff_eq(Vec3::NEG_Z * 2.0, 1e-6));
    let fourth = at(2.5);
    assert!(fourth.velocity.abs_diff_eq(Vec3::NEG_Z, 1e-6));
    assert_eq!((fourth.style.as_deref(), fourth.gait), (Some("old"), None));
    assert_eq!(at(3.0).velocity, Vec3::ZERO);
    assert_eq!(path.limit_s(), 5.0);
    // 1 s along +X at 1 m/s, then half a second back at 2 m/s and a second at 1 m/s.
    let way = path.commanded(9.0);
    assert!(
        way.last().unwrap().abs_diff_eq(Vec2::new(1.0, -2.0), 1e-5),
        "{way:?}"
    );
}

/// Moves a point without inertia along a path, and returns its place at each tenth of a second.
fn follow(path: &Path, disturb: Vec2) -> (Vec<Vec2>, f32, usize) {
    let mut player = Player::new(path);
    let (mut at, mut way) = (path.start, Vec::new());
    let (mut commands, mut last) = (0, Vec3::ZERO);
    let mut time_s = 0.0;
    while time_s < player.ends_s() {
        let velocity = player.intent(time_s, at).unwrap().velocity;
        commands += usize::from(velocity != last);
        last = velocity;
        if velocity != Vec3::ZERO {
            at += (Vec2::new(velocity.x, velocity.z) + disturb) * 0.1;
        }
        way.push(at);
        time_s += 0.1;
    }
    (way, time_s, commands)
}

#[test]
fn waypoints_are_reached_one_after_the_other() {
    let path = parse(
        "[[waypoint]]\nat = [0, 4]\nspeed = 1\nwait_s = 1\n[[waypoint]]\nat = [4, 4]\n[[waypoint]]\nat = [0, 0]\nspeed = 2\n",
    );
    for disturb in [Vec2::ZERO, Vec2::new(0.2, 0.1)] {
        let (way, seconds, commands) = follow(&path, disturb);
        for point in &path.waypoints {
            let nearest = way.iter().map(|p| p.distance(point.at)).fold(f32::MAX, f32::min);
            assert!(nearest < 0.8, "{nearest} from {}", point.at);
        }
        let stands = way.windows(2).filter(|pair| pair[0] == pair[1]).count();
        assert!(stands >= 10, "a second at the first and two at the end: {stands}");
        assert!(seconds < path.limit_s(), "done before the limit: {seconds}");
        assert!(commands < 25, "not a new command all the time: {commands}");
    }
}

#[test]
fn a_waypoint_that_was_passed_by_counts() {
    let path = parse("[[waypoint]]\nat = [0, 4]\nspeed = 1\n[[waypoint]]\nat = [4, 4]\n");
    let mut player = Player::new(&path);
    player.intent(0.0, Vec2::ZERO);
    let velocity = player.intent(5.0, Vec2::new(-1.5, 4.1)).unwrap().velocity;
    assert!(velocity.x.atan2(velocity.z) > FRAC_PI_2 - 0.1, "{velocity}");
}

#[test]
fn objects_are_used_one_after_the_other() {
    let path = parse(
        "scene = 'yard'\n\
         [[command]]\ntime_s = 0\nspeed = 1\n\
         [[command]]\ntime_s = 1\ninteract = 'seat'\nvariant = 'upright'\napproach = 'front'\n\
         [[command]]\nafter = 'held'\nwait_s = 2\nend = true\n\
         [[command]]\nafter = 'done'\nspeed = 0.5\n\
         [[command]]\nwait_s = 1\nspeed = 0\n",
    );
    assert_eq!(path.scene.as_deref(), Some("yard"));
    let mut player = Player::new(&path);
    let look = |player: &mut Player<'_>, time_s| {
        let speed = player
            .intent(time_s, Vec2::ZERO)
            .map(|intent| intent.velocity.length());
        (speed, player.take_acts().cloned().collect::<Vec<_>>())
    };
    let sit = Act::interact("seat").variant("upright").approach("front");
    assert_eq!(look(&mut player, 0.0), (Some(1.0), vec![]));
    assert_eq!(look(&mut player, 1.0), (None, vec![sit]));
    assert_eq!(
        look(&mut player, 9.0),
        (None, vec![]),
        "it does not know when it will sit"
    );
    assert_eq!(player.next_command_s(), None);
    player.came(Moment::Held, 9.5);
    assert_eq!(player.next_command_s(), Some(11.5));
    assert_eq!(look(&mut player, 11.4), (None, vec![]));
    assert_eq!(look(&mut player, 11.5), (None, vec![Act::EndInteraction]));
    // Standing up takes its time.
    assert_eq!(look(&mut player, 12.0), (None, vec![]));
    player.came(Moment::Done, 13.0);
    assert_eq!(look(&mut player, 13.0), (Some(0.5), vec![]));
    assert_eq!(look(&mut player, 13.9), (Some(0.5), vec![]));
    assert!(player.ends_s() > 30.0, "the end is not known yet");
    assert_eq!(look(&mut player, 14.0), (Some(0.0), vec![]));
    assert_eq!(player.ends_s(), 16.0);
}

#[test]
fn what_does_not_come_is_not_waited_for_forever() {
    let text = "[[command]]\ntime_s = 1\ninteract = 'seat'\n[[command]]\nafter = 'done'\nspeed = 1\n";
    let path = parse(text);
    let mut player = Player::new(&path);
    player.intent(1.0, Vec2::ZERO);
    // It sits, and nothing ends that.
    player.came(Moment::Held, 4.0);
    assert_eq!(player.waits_in_vain(30.9), None);
    assert!(path.limit_s() > 31.0);
    assert_eq!(player.waits_in_vain(31.0), Some((2, Moment::Done)));
    let timed = parse(&format!("seconds = 100\n{text}"));
    let mut player = Player::new(&timed);
    player.intent(1.0, Vec2::ZERO);
    assert_eq!(player.waits_in_vain(90.0), None);
    player.came(Moment::Done, 91.0);
    assert_eq!(player.next_command_s(), Some(91.0));
}

#[test]
fn what_is_held_last_is_the_end() {
    let path = parse("[[command]]\ntime_s = 0\ninteract = 'seat'\n");
    let mut player = Player::new(&path);
    assert_eq!(player.intent(0.0, Vec2::ZERO), None);
    assert_eq!(player.ends_s(), path.limit_s());
    player.came(Moment::Held, 3.0);
    player.intent(3.0, Vec2::ZERO);
    assert_eq!(player.ends_s(), 5.0);
    // One that never gets there ends too.
    assert!((30.0..40.0).contains(&path.limit_s()), "{}", path.limit_s());
}

#[test]
fn waypoints_wait_while_an_object_is_used() {
    let path = parse(
        "[[waypoint]]\nat = [0, 4]\nspeed = 1\n\
         [[command]]\ntime_s = 1\ninteract = 'cup'\n\
         [[command]]\nafter = 'held'\n",
    );
    let mut player = Player::new(&path);
    assert!(player.intent(0.0, Vec2::ZERO).is_some());
    assert_eq!(player.intent(1.0, Vec2::Y), None);
    // What says nothing goes on, with the cup in the hand.
    player.came(Moment::Held, 4.0);
    let velocity = player.intent(4.0, Vec2::Y).unwrap().velocity;
    assert!(velocity.abs_diff_eq(Vec3::Z, 1e-5), "{velocity}");
    player.intent(7.0, Vec2::new(0.0, 3.9));
    assert_eq!(player.ends_s(), 9.0);
}

#[test]
fn a_sentence_is_acted_out_until_the_next_command() {
    let path = parse(
        "[[command]]\ntime_s = 0\nspeed = 1\n\
         [[command]]\ntime_s = 1\nperform = 'a person bows'\n\
         [[command]]\ntime_s = 4\nspeed = 2\n",
    );
    let mut player = Player::new(&path);
    assert!(player.intent(0.5, Vec2::ZERO).is_some());
    assert_eq!(player.take_acts().count(), 0);
    for time_s in [1.0, 2.0, 3.9] {
        assert!(
            player.intent(time_s, Vec2::ZERO).is_none(),
            "a command would end it"
        );
        let acts: Vec<&Act> = player.take_acts().collect();
        let bows = Act::from(troupe_client::Performance::of("a person bows"));
        assert_eq!(acts, [&bows][..usize::from(time_s == 1.0)]);
    }
    assert!(
        player
            .intent(4.0, Vec2::ZERO)
            .is_some_and(|intent| intent.velocity.length() > 1.9)
    );
}

#[test]
fn a_skill_is_done_and_waited_for() {
    let path = parse(
        "[[command]]\ntime_s = 1\nskill = 'lie-down'\nvariant = 'back'\n\
         [[command]]\nafter = 'held'\nspeed = 0.5\n",
    );
    let mut player = Player::new(&path);
    player.intent(1.0, Vec2::ZERO);
    let acts: Vec<_> = player.take_acts().cloned().collect();
    assert_eq!(acts, [Act::skill("lie-down").variant("back")]);
    assert_eq!(player.next_command_s(), None, "it does not know when it will lie");
    player.came(Moment::Held, 4.0);
    assert_eq!(player.next_command_s(), Some(4.0));
    for (text, wanted) in [
        ("skill = 'jump'\ncancel = true", "exclude each other"),
        ("skill = 'jump'\nspeed = 1", "exclude what says how to move"),
        ("skill = 'jump'\napproach = 'front'", "approach needs interact"),
        ("speed = 1\nvariant = 'back'", "variant needs interact or skill"),
    ] {
        let error = Path::parse(&format!("[[command]]\ntime_s = 1\n{text}")).unwrap_err();
        assert!(error.contains(wanted), "{text}: {error}");
    }
}

#[test]
fn a_path_takes_the_size_of_a_character() {
    let path = parse(
        "start = [1, 2]
        [[waypoint]]
        at = [3, 4]
        speed = 1.5
        height_m = 0.8",
    );
    let half = path.sized(0.5);
    assert_eq!(
        (half.start, half.waypoints[0].at),
        (path.start * 0.5, path.waypoints[0].at * 0.5)
    );
    assert_eq!(half.waypoints[0].speed_mps, 0.75);
    assert_eq!(half.waypoints[0].manner.height_m, Some(0.4));
    assert_eq!(half.sized(2.0), path);
}
