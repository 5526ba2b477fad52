//! A definition that tests share, for the walker of the style tests.

use super::Definition;
use crate::style::testing::walker_rig;

/// Uses everything that a definition can contain at least once.
pub const CUP: &str = r#"
format = 1
name = "cup"
description = "A cup to pick up and put down."

[shape.box]
center_m = [0.0, 0.05, 0.0]
half_extents_m = [0.04, 0.05, 0.04]

[trigger]
reach_m = 0.8

[anchor]
pivot_m = [0.0, 0.05, 0.0]

[release]
max_drop_m = 1.5
max_slope_deg = 25.0
align = "upright"

[[approaches]]
name = "front"
directions_deg = [-70.0, 70.0]
distance_m = 0.9

[[sockets]]
name = "foot"
joint = "Foot_R"
position_m = [0.0, -0.1, 0.02]
rotation = [0.7071068, 0.7071068, 0.0, 0.0]

[[variants]]
name = "slow"
entry = "reach"
exit = "put-down"

[[variants]]
name = "quick"
weight = 3.0
entry = "grab"

[[sets]]
name = "reach"
next = "lift"
events = [{ attach = "foot" }]

[[sets.keyframes]]
pivot = true
place_m = [0.0, 0.45]
heading_deg = 180.0
height_m = 0.8
from_ground = true
rotations = [
    1.0, 0.0, 0.0, 0.0,  1.0, 0.0, 0.0, 0.0,  1.0, 0.0, 0.0, 0.0,
    1.0, 0.0, 0.0, 0.0,  1.0, 0.0, 0.0, 0.0,  1.0, 0.0, 0.0, 0.0,
]
points = [{ joint = "Foot_R", position_m = [0.0, 0.12, 0.05] }]

[[sets]]
name = "lift"
drop_frames = 6
frames = 20
hold_until_ended = true

[[sets.keyframes]]
height_m = 0.9
from_ground = true

[[sets]]
name = "grab"
origin = "character"
hold_frames = 10
events = [{ at = "start", attach = "foot" }]
keyframes = [{ height_m = 0.7 }, { height_m = 0.75, place_m = [0.0, 0.1] }]

[[sets]]
name = "put-down"
origin = "character"
motion = "stance"
from_stand = true
events = [{ release = true }]
keyframes = [{ points = [{ joint = "Foot_R", position_m = [0.1, 0.3, 0.4] }] }]
"#;

/// [`CUP`], read and checked.
pub fn definition() -> Definition {
    Definition::from_toml(CUP, &walker_rig()).unwrap()
}
