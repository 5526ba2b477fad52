var e=[[`cup.toml`,`# A cup to take from a table of 0.7 to 1.0 m and to put down again. sign.toml explains the fields that are not explained here.
#
# The pose of \`bend\` is the standing key of the pack's style \`normal\`, bent by hand; like the pack's styles, and like the clips
# that other variants are made from, it is CC BY-NC 4.0 (see NOTICE).

format = 1
name = "cup"
description = "A cup to pick up, carry and put down."

[shape.box]
center_m = [0.0, 0.06, 0.0]
half_extents_m = [0.04, 0.06, 0.04]

[trigger]
reach_m = 0.9

# How it is put down. With \`snap\` (default true) a ray goes down from \`lift_m\` (default 0.3) above the object's middle, and
# the object goes onto the surface that it finds, at most \`max_drop_m\` (default 2) below the middle and \`max_slope_deg\`
# (default 30, at most 80) steep. \`align\`: "upright" (default), "surface" (along its normal) or "keep".
[release]
max_drop_m = 1.2
max_slope_deg = 20.0
align = "upright"

# Places on a character that hold the object: the object's origin in the joint's frame, and its \`rotation\` there, w, x, y, z.
# Without \`rotation\`, as here, the object keeps the turn in which it was taken. On attaching it moves there over \`blend_frames\`
# (0 to 30, default 4). A walking character keeps the hand still before the hips; with \`swings = true\` (default false) the arm
# swings as in any walk. With \`upright = true\` (default false) it stands upright however the hand turns, as a full cup must.
[[sockets]]
name = "right-hand"
joint = "Hand_R"
position_m = [-0.1, 0.015, 0.015]
blend_frames = 4
upright = true

# No approaches: a cup is taken from any side.

# A whole pose reaches one height only, here 0.85 m: so this one is chosen by name alone.
[[variants]]
name = "bend"
weight = 0.0
entry = "reach"
exit = "put-down"

[[variants]]
name = "upright"
entry = "reach-upright"
exit = "put-down"

[[sets]]
name = "reach"
next = "lift"
# What happens, at "start", "reached" (default) or "end" of the set: the object goes to a socket, or is put down.
events = [{ attach = "right-hand" }]

[[sets.keyframes]]
pivot = true
place_m = [-0.1, 0.46]
heading_deg = 180.0
height_m = 0.9226
from_ground = true
rotations = [
    0.71742, -0.02742, 0.02828, 0.69553,  # Hips
    0.68522, 0.69066, -0.15949, 0.16741,  # Spine
    0.99480, -0.00450, 0.01055, 0.10116,  # Chest
    0.99697, -0.01517, -0.00374, 0.07618,  # Neck
    0.99936, -0.01489, -0.01566, 0.02848,  # Head
    0.55217, -0.41462, -0.43500, -0.57791,  # Shoulder_L
    0.76775, 0.24114, -0.25700, -0.53514,  # UpperArm_L
    0.96063, 0.10988, -0.25505, 0.00847,  # LowerArm_L
    0.99620, 0.07110, -0.02251, 0.04496,  # Hand_L
    0.59604, 0.45783, -0.40199, 0.52301,  # Shoulder_R
    0.66275, -0.11086, -0.58344, -0.45615,  # UpperArm_R
    0.96117, 0.03469, -0.26371, 0.07350,  # LowerArm_R
    0.99656, 0.04737, -0.00888, 0.06740,  # Hand_R
    0.03795, -0.01335, 0.06629, -0.99699,  # UpperLeg_L
    0.98168, 0.00167, 0.19054, -0.00034,  # LowerLeg_L
    0.82899, 0.03752, -0.55770, -0.01836,  # Foot_L
    0.99079, -0.00153, -0.13536, 0.00382,  # Toes_L
    0.12133, 0.99256, -0.00397, 0.00955,  # UpperLeg_R
    0.98636, -0.00082, 0.16456, -0.00280,  # LowerLeg_R
    0.83282, 0.06084, -0.54994, -0.01669,  # Foot_R
    0.99042, 0.00535, -0.13778, -0.00750,  # Toes_R
]

# The same with the hand alone, for more variety. Its place counts from the cup, wherever that stands; so the root's height is
# left free.
[[sets]]
name = "reach-upright"
next = "lift"
events = [{ attach = "right-hand" }]

[[sets.keyframes]]
pivot = true
place_m = [-0.1, 0.42]
heading_deg = 180.0
points = [{ joint = "Hand_R", position_m = [0.0, 0.09, 0.08] }]

# Up again with the cup, softly; then it is carried until the interaction is ended, which goes on with \`exit\`.
[[sets]]
name = "lift"
origin = "character"
frames = 18
drop_frames = 8
hold_until_ended = true
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.2, 1.05, 0.3] }] }]

[[sets]]
name = "put-down"
origin = "character"
events = [{ release = true }]
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.15, 0.98, 0.38] }] }]

# Variant chest, made from dataset-1_guide_happy_001.bvh, frames 48, 18, 46, for pack human; the poses are under the clip's licence.

# Where the object is in the joint's frame while it is held.
[[sockets]]
name = "hand-r"
joint = "Hand_R"
position_m = [-0.1359, -0.0215, 0.0321]
rotation = [0.61307, 0.06889, 0.55059, -0.56237]
upright = true

[[variants]]
name = "chest"
entry = "chest-reach"
exit = "chest-put-down"

# Frame 48 of the clip.
[[sets]]
name = "chest-reach"
next = "chest-lift"
events = [{ attach = "hand-r" }]

[[sets.keyframes]]
pivot = true
place_m = [-0.1131, 0.5231]
heading_deg = 180.0
points = [
    { joint = "Hand_R", position_m = [-0.0215, 0.1289, 0.0538] },
]

# Frame 18 of the clip.
[[sets]]
name = "chest-lift"
# From where the character is by then.
origin = "character"
# As long as in the clip.
frames = 30
hold_until_ended = true

[[sets.keyframes]]
from_ground = true
points = [
    { joint = "Hand_R", position_m = [-0.1452, 1.2227, 0.2239] },
]

# Frame 46 of the clip.
[[sets]]
name = "chest-put-down"
# From where the character is by then.
origin = "character"
# As long as in the clip.
frames = 28
events = [{ release = true }]

[[sets.keyframes]]
from_ground = true
points = [
    { joint = "Hand_R", position_m = [-0.0652, 0.9607, 0.4119] },
]

# Variant offer, made from dataset-1_guide_proud_001.bvh, frames 23, 60, 89, for pack human; the poses are under the clip's licence.

# Where the object is in the joint's frame while it is held.
[[sockets]]
name = "hand-r-offer"
joint = "Hand_R"
position_m = [-0.1313, -0.0167, 0.0402]
rotation = [-0.53402, -0.04006, -0.59463, 0.5997]
upright = true

[[variants]]
name = "offer"
entry = "offer-reach"
exit = "offer-put-down"

# Frame 23 of the clip.
[[sets]]
name = "offer-reach"
next = "offer-lift"
events = [{ attach = "hand-r-offer" }]

[[sets.keyframes]]
pivot = true
place_m = [-0.2458, 0.4188]
heading_deg = 180.0
points = [
    { joint = "Hand_R", position_m = [-0.0384, 0.1219, 0.0528] },
]

# Frame 60 of the clip.
[[sets]]
name = "offer-lift"
# From where the character is by then.
origin = "character"
# As long as in the clip.
frames = 37
hold_until_ended = true

[[sets.keyframes]]
from_ground = true
points = [
    { joint = "Hand_R", position_m = [-0.2085, 1.1727, 0.4006] },
]

# Frame 89 of the clip.
[[sets]]
name = "offer-put-down"
# From where the character is by then.
origin = "character"
# As long as in the clip.
frames = 29
events = [{ release = true }]

[[sets.keyframes]]
from_ground = true
points = [
    { joint = "Hand_R", position_m = [-0.2795, 1.0167, 0.3084] },
]
`],[`greeter.toml`,`# A place to wave at: no body. sign.toml explains the fields. Of the pose, \`right\` and \`left\` say nothing but where a hand is.

format = 1
name = "greeter"
description = "A place where characters turn around and wave."
solid = false
shared = true

[shape.box]
center_m = [0.0, 0.9, 0.0]
half_extents_m = [0.3, 0.9, 0.3]

[trigger]
reach_m = 2.5

[[variants]]
name = "right"
entry = "turn-right"

[[variants]]
name = "left"
entry = "turn-left"

# First it turns to the place, from whatever side it is on: the pivot flag alone, with a heading and no place.
[[sets]]
name = "turn-right"
next = "right-up"
drop_frames = 4
keyframes = [{ pivot = true, heading_deg = 180.0 }]

# Then it waves where it stands: the origin of these sets is the character, x to its left, z ahead of it.
[[sets]]
name = "right-up"
next = "right-out"
origin = "character"
# Points say where single joints are and leave the rest free, at most eight a keyframe.
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.25, 1.60, 0.20] }] }]

[[sets]]
name = "right-out"
next = "right-in"
origin = "character"
drop_frames = 2
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.38, 1.55, 0.18] }] }]

[[sets]]
name = "right-in"
origin = "character"
drop_frames = 2
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.18, 1.60, 0.22] }] }]

[[sets]]
name = "turn-left"
next = "left-up"
drop_frames = 4
keyframes = [{ pivot = true, heading_deg = 180.0 }]

[[sets]]
name = "left-up"
next = "left-out"
origin = "character"
keyframes = [{ from_ground = true, points = [{ joint = "Hand_L", position_m = [0.25, 1.60, 0.20] }] }]

[[sets]]
name = "left-out"
next = "left-in"
origin = "character"
drop_frames = 2
keyframes = [{ from_ground = true, points = [{ joint = "Hand_L", position_m = [0.38, 1.55, 0.18] }] }]

[[sets]]
name = "left-in"
origin = "character"
drop_frames = 2
keyframes = [{ from_ground = true, points = [{ joint = "Hand_L", position_m = [0.18, 1.60, 0.22] }] }]

# Variant big, made from dataset-1_bye_giant_001.bvh, frames 44, 66, 91, 115, for pack human; the poses are under the clip's licence.

[[variants]]
name = "big"
entry = "big-in"

# Frame 44 of the clip.
[[sets]]
name = "big-in"
next = "big-out"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.4]
heading_deg = 180.0
height_m = 0.9072
from_ground = true
rotations = [
    0.71024, -0.02677, 0.02705, 0.70293,  # Hips
    0.69656, 0.717, -0.0232, -0.01289,  # Spine
    0.99687, 0.02889, -0.05102, -0.05311,  # Chest
    0.99509, -0.07117, 0.06841, -0.00716,  # Neck
    0.9979, -0.05987, -0.00327, 0.0244,  # Head
    0.50851, -0.47995, -0.4876, -0.52279,  # Shoulder_L
    0.84542, 0.30582, -0.00477, -0.43785,  # UpperArm_L
    0.87063, -0.28101, -0.38426, -0.12403,  # LowerArm_L
    0.99519, 0.05121, -0.07654, 0.03333,  # Hand_L
    0.47309, 0.4653, -0.50714, 0.55,  # Shoulder_R
    0.67039, -0.51187, -0.50206, 0.19107,  # UpperArm_R
    0.96598, -0.0095, -0.25844, -0.00255,  # LowerArm_R
    0.99451, 0.05138, -0.04267, 0.08057,  # Hand_R
    0.14226, -0.03067, 0.17149, -0.97438,  # UpperLeg_L
    0.98483, 0.00321, 0.17349, -0.00043,  # LowerLeg_L
    0.86274, -0.08316, -0.49153, -0.08461,  # Foot_L
    0.98955, 1e-5, -0.14416, -9e-5,  # Toes_L
    0.23031, 0.96363, -0.13234, -0.02941,  # UpperLeg_R
    0.98317, 0.00259, 0.18268, -0.0003,  # LowerLeg_R
    0.86138, -0.05796, -0.49727, -0.08601,  # Foot_R
    0.98956, 0.00017, -0.14413, -0.00054,  # Toes_R
]

# Frame 66 of the clip.
[[sets]]
name = "big-out"
next = "big-back"
# As long as in the clip.
frames = 22
# Soft: what follows may begin so many frames earlier.
drop_frames = 2

[[sets.keyframes]]
pivot = true
place_m = [-0.0058, 1.3916]
heading_deg = 177.2
height_m = 0.9065
from_ground = true
rotations = [
    0.70783, -0.02492, 0.025, 0.7055,  # Hips
    0.70684, 0.70696, -0.0224, -0.00957,  # Spine
    0.99775, 0.00017, -0.04519, -0.04957,  # Chest
    0.99848, -0.04021, 0.03667, -0.00865,  # Neck
    0.99878, -0.03662, 0.00033, 0.03303,  # Head
    0.50788, -0.47902, -0.48772, -0.52415,  # Shoulder_L
    0.84466, 0.30918, -0.00085, -0.43698,  # UpperArm_L
    0.86931, -0.28579, -0.3831, -0.12594,  # LowerArm_L
    0.99518, 0.05119, -0.07697, 0.03276,  # Hand_L
    0.48692, 0.50208, -0.51017, 0.50055,  # Shoulder_R
    0.8745, -0.47567, -0.06669, 0.06741,  # UpperArm_R
    0.98789, -0.01189, -0.15466, -0.00187,  # LowerArm_R
    0.99651, 0.04926, -0.03004, 0.06025,  # Hand_R
    0.13677, -0.02203, 0.18316, -0.97327,  # UpperLeg_L
    0.9843, 0.00339, 0.17645, -0.00047,  # LowerLeg_L
    0.85658, -0.09588, -0.50073, -0.07969,  # Foot_L
    0.98955, 0.0, -0.14416, -9e-5,  # Toes_L
    -0.21501, -0.96627, 0.13788, 0.03299,  # UpperLeg_R
    0.98378, 0.00273, 0.17937, -0.00033,  # LowerLeg_R
    0.86198, -0.05212, -0.49559, -0.09313,  # Foot_R
    0.98956, 0.0002, -0.14413, -0.00056,  # Toes_R
]

# Frame 91 of the clip.
[[sets]]
name = "big-back"
next = "big-end"
# As long as in the clip.
frames = 25
# Soft: what follows may begin so many frames earlier.
drop_frames = 2

[[sets.keyframes]]
pivot = true
place_m = [-0.004, 1.3965]
heading_deg = 179.0
height_m = 0.9072
from_ground = true
rotations = [
    0.70938, -0.02492, 0.02511, 0.70394,  # Hips
    0.69618, 0.71722, -0.02629, -0.01533,  # Spine
    0.99646, 0.02973, -0.05882, -0.05216,  # Chest
    0.99581, -0.06402, 0.06454, -0.01034,  # Neck
    0.99796, -0.05543, -0.0079, 0.03059,  # Head
    0.5076, -0.47752, -0.48737, -0.52611,  # Shoulder_L
    0.84875, 0.29908, -0.00784, -0.43601,  # UpperArm_L
    0.87198, -0.281, -0.38155, -0.12295,  # LowerArm_L
    0.99527, 0.05114, -0.07573, 0.03309,  # Hand_L
    0.46737, 0.46884, -0.51287, 0.54655,  # Shoulder_R
    0.66755, -0.50477, -0.5114, 0.19509,  # UpperArm_R
    0.96337, -0.02975, -0.2664, -0.00823,  # LowerArm_R
    0.99467, 0.05152, -0.04568, 0.07671,  # Hand_R
    0.13869, -0.02911, 0.17445, -0.97441,  # UpperLeg_L
    0.98448, 0.00315, 0.17548, -0.00043,  # LowerLeg_L
    0.85994, -0.0885, -0.49601, -0.08149,  # Foot_L
    0.98955, 1e-5, -0.14416, -0.00012,  # Toes_L
    0.21964, 0.96591, -0.13379, -0.02947,  # UpperLeg_R
    0.98425, 0.00235, 0.17678, -0.00026,  # LowerLeg_R
    0.86244, -0.06203, -0.49466, -0.08756,  # Foot_R
    0.98956, 0.00016, -0.14413, -0.00049,  # Toes_R
]

# Frame 115 of the clip.
[[sets]]
name = "big-end"
# As long as in the clip.
frames = 24
# Soft: what follows may begin so many frames earlier.
drop_frames = 4

[[sets.keyframes]]
pivot = true
place_m = [-0.0051, 1.3888]
heading_deg = 177.7
height_m = 0.9052
from_ground = true
rotations = [
    0.70692, -0.03009, 0.03013, 0.70601,  # Hips
    0.7073, 0.70639, -0.02563, -0.00972,  # Spine
    0.99773, -0.00129, -0.04998, -0.0452,  # Chest
    0.99917, -0.03234, 0.02318, 0.00827,  # Neck
    0.99811, -0.03879, 0.00132, 0.04759,  # Head
    0.50479, -0.46367, -0.48382, -0.54417,  # Shoulder_L
    0.85013, 0.3061, 0.00237, -0.42845,  # UpperArm_L
    0.86954, -0.28712, -0.38157, -0.126,  # LowerArm_L
    0.99534, 0.05097, -0.0759, 0.03074,  # Hand_L
    0.50945, 0.49775, -0.4925, 0.50015,  # Shoulder_R
    0.87813, -0.46753, -0.05871, 0.08282,  # UpperArm_R
    0.98839, -0.03649, -0.14738, -0.00545,  # LowerArm_R
    0.99695, 0.04928, -0.03504, 0.04928,  # Hand_R
    0.13858, -0.01665, 0.18159, -0.97342,  # UpperLeg_L
    0.98339, 0.00354, 0.18149, -0.00051,  # LowerLeg_L
    0.85497, -0.09231, -0.50372, -0.08231,  # Foot_L
    0.98955, 0.0, -0.14416, -0.00011,  # Toes_L
    0.21206, 0.96664, -0.14126, -0.02636,  # UpperLeg_R
    0.98242, 0.00302, 0.18665, -0.00039,  # LowerLeg_R
    0.85854, -0.05728, -0.5011, -0.09237,  # Foot_R
    0.98956, 0.00021, -0.14413, -0.0006,  # Toes_R
]

# Variant low, made from dataset-1_bye_normal_001.bvh, frames 20, 96, for pack human; the poses are under the clip's licence.

[[variants]]
name = "low"
entry = "low-up"

# Frame 20 of the clip.
[[sets]]
name = "low-up"
next = "low-down"
hold_frames = 30

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.4]
heading_deg = 180.0
height_m = 0.9403
from_ground = true
rotations = [
    0.70077, 0.00932, -0.00916, 0.71327,  # Hips
    0.69379, 0.71832, 0.04447, 0.02627,  # Spine
    0.99968, 0.01746, 0.01731, -0.0059,  # Chest
    0.99493, 0.03817, 0.08908, 0.02677,  # Neck
    0.99237, 0.04516, 0.11473, 0.00107,  # Head
    0.48957, -0.46258, -0.51063, -0.53442,  # Shoulder_L
    0.77216, -0.15877, 0.16951, -0.59146,  # UpperArm_L
    0.98802, 0.0, -0.15435, 0.0,  # LowerArm_L
    0.90937, 0.41069, 0.015, 0.06449,  # Hand_L
    0.55989, 0.52771, -0.43265, 0.46996,  # Shoulder_R
    0.80704, -0.33974, 0.05872, -0.47939,  # UpperArm_R
    0.5546, 0.0, -0.83211, 0.0,  # LowerArm_R
    0.85857, 0.32898, -0.33452, 0.20669,  # Hand_R
    0.02985, 0.0195, -0.01687, 0.99922,  # UpperLeg_L
    1.0, 0.0, 1e-5, 0.0,  # LowerLeg_L
    0.90247, -0.0717, -0.42084, 0.05744,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    -0.12134, 0.99253, 0.01206, -0.00419,  # UpperLeg_R
    0.99785, 0.0, 0.06557, 0.0,  # LowerLeg_R
    0.81726, -0.30564, -0.46743, 0.14202,  # Foot_R
    0.98955, 0.0, -0.14416, 0.0,  # Toes_R
]

# Frame 96 of the clip.
[[sets]]
name = "low-down"
# Soft: what follows may begin so many frames earlier.
drop_frames = 8

[[sets.keyframes]]
pivot = true
place_m = [0.0106, 1.3966]
heading_deg = 177.22
height_m = 0.9398
from_ground = true
rotations = [
    0.70002, 0.00523, -0.00513, 0.71408,  # Hips
    0.6998, 0.71379, 0.02774, -0.00348,  # Spine
    0.99986, 0.00995, 0.00521, -0.01273,  # Chest
    0.99957, 0.02865, -0.00165, -0.00531,  # Neck
    0.99923, 0.03666, 0.00461, -0.01317,  # Head
    0.48331, -0.4523, -0.51652, -0.54318,  # Shoulder_L
    0.7828, -0.20976, 0.21188, -0.5462,  # UpperArm_L
    0.98768, 0.0, -0.15648, 0.0,  # LowerArm_L
    0.91799, 0.38468, 0.01657, 0.09512,  # Hand_L
    0.55888, 0.52208, -0.43453, 0.47568,  # Shoulder_R
    0.79847, -0.20737, 0.23044, -0.51609,  # UpperArm_R
    0.83769, 0.0, -0.54615, 1e-5,  # LowerArm_R
    0.86059, 0.39709, -0.28888, 0.13509,  # Hand_R
    0.02414, 0.01012, -0.02444, 0.99936,  # UpperLeg_L
    1.0, 0.0, 1e-5, 0.0,  # LowerLeg_L
    0.89975, -0.08993, -0.42305, 0.05822,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    0.12953, -0.99143, -0.01713, 0.00037,  # UpperLeg_R
    0.99749, 0.0, 0.07081, 0.0,  # LowerLeg_R
    0.82, -0.29007, -0.47295, 0.14065,  # Foot_R
    0.98955, 0.0, -0.14416, 0.0,  # Toes_R
]

# Variant tired, made from dataset-2_wave-left-hand_exhausted_001.bvh, frames 42, 59, 79, 98, 175, for pack human; the poses are under the clip's licence.

[[variants]]
name = "tired"
entry = "tired-in"

# Frame 42 of the clip.
[[sets]]
name = "tired-in"
next = "tired-out"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.4]
heading_deg = 180.0
height_m = 0.9081
from_ground = true
rotations = [
    0.71602, -0.07103, 0.07365, 0.69054,  # Hips
    0.71375, 0.69466, -0.03878, 0.08067,  # Spine
    0.99275, -0.02692, 0.0591, 0.10119,  # Chest
    0.95823, -0.09921, -0.02547, 0.26703,  # Neck
    0.97826, -0.14066, 0.11572, 0.09919,  # Head
    0.6411, -0.41177, -0.35, -0.54492,  # Shoulder_L
    0.65978, -0.62843, -0.41036, 0.03692,  # UpperArm_L
    0.81829, 0.11409, -0.55797, 0.0778,  # LowerArm_L
    0.97861, 0.05321, -0.02415, 0.19723,  # Hand_L
    0.58621, 0.48691, -0.41373, 0.49811,  # Shoulder_R
    0.82075, 0.16433, -0.22868, -0.49706,  # UpperArm_R
    0.98477, 0.05867, -0.16337, 0.00972,  # LowerArm_R
    0.99224, 0.0486, -0.01237, 0.11378,  # Hand_R
    0.0993, 0.0025, 0.08721, -0.99123,  # UpperLeg_L
    0.96664, 0.00377, 0.25612, -0.001,  # LowerLeg_L
    0.82275, 0.04917, -0.56197, -0.06969,  # Foot_L
    0.98949, -1e-5, -0.14459, 0.0,  # Toes_L
    0.25697, 0.9654, -0.01315, 0.04238,  # UpperLeg_R
    0.97148, 0.00279, 0.23711, -0.00065,  # LowerLeg_R
    0.80228, 0.1747, -0.5702, -0.02643,  # Foot_R
    0.98882, -0.00012, -0.14912, 1e-5,  # Toes_R
]

# Frame 59 of the clip.
[[sets]]
name = "tired-out"
next = "tired-back"
# As long as in the clip.
frames = 17
# Soft: what follows may begin so many frames earlier.
drop_frames = 2

[[sets.keyframes]]
pivot = true
place_m = [0.0176, 1.3785]
heading_deg = 179.69
height_m = 0.9047
from_ground = true
rotations = [
    0.71846, -0.06276, 0.06538, 0.68964,  # Hips
    0.71509, 0.69391, -0.02884, 0.07943,  # Spine
    0.99334, -0.02988, 0.07138, 0.08542,  # Chest
    0.96889, -0.10957, 0.01655, 0.22131,  # Neck
    0.97604, -0.15372, 0.1281, 0.08544,  # Head
    0.62301, -0.41213, -0.3668, -0.5545,  # Shoulder_L
    0.77028, -0.57803, -0.26374, -0.05471,  # UpperArm_L
    0.96127, 0.2012, -0.18434, 0.03858,  # LowerArm_L
    0.9877, 0.04375, 0.01744, 0.14907,  # Hand_L
    0.59077, 0.48128, -0.40901, 0.50206,  # Shoulder_R
    0.82643, 0.16101, -0.21586, -0.49447,  # UpperArm_R
    0.98592, 0.06453, -0.15392, 0.01006,  # LowerArm_R
    0.99236, 0.04842, -0.01133, 0.11288,  # Hand_R
    0.11337, 0.0044, 0.08792, -0.98965,  # UpperLeg_L
    0.96711, 0.00427, 0.25432, -0.00112,  # LowerLeg_L
    0.81579, 0.04336, -0.57092, -0.0816,  # Foot_L
    0.98951, -1e-5, -0.14449, 0.0,  # Toes_L
    0.25891, 0.96462, -0.0002, 0.04977,  # UpperLeg_R
    0.97246, 0.00325, 0.23307, -0.00075,  # LowerLeg_R
    0.79316, 0.1795, -0.58156, -0.02166,  # Foot_R
    0.98956, 0.0, -0.14413, 0.0,  # Toes_R
]

# Frame 79 of the clip.
[[sets]]
name = "tired-back"
next = "tired-again"
# As long as in the clip.
frames = 20

[[sets.keyframes]]
pivot = true
place_m = [0.0054, 1.3732]
heading_deg = 179.65
height_m = 0.9052
from_ground = true
rotations = [
    0.72135, -0.0607, 0.06374, 0.68695,  # Hips
    0.7147, 0.696, -0.02504, 0.06452,  # Spine
    0.99635, -0.02642, 0.05576, 0.05897,  # Chest
    0.97576, -0.0882, 0.00506, 0.20021,  # Neck
    0.97562, -0.14042, 0.15261, 0.07178,  # Head
    0.64568, -0.41011, -0.34535, -0.54373,  # Shoulder_L
    0.66328, -0.58054, -0.46936, 0.0523,  # UpperArm_L
    0.84615, 0.11479, -0.51572, 0.06996,  # LowerArm_L
    0.98729, 0.05329, -0.03486, 0.1456,  # Hand_L
    0.58187, 0.48721, -0.41805, 0.49928,  # Shoulder_R
    0.80939, 0.17331, -0.21597, -0.51789,  # UpperArm_R
    0.98426, 0.06241, -0.16499, 0.01045,  # LowerArm_R
    0.99212, 0.04869, -0.01291, 0.11468,  # Hand_R
    0.10932, 0.0037, 0.08586, -0.99028,  # UpperLeg_L
    0.96598, 0.00416, 0.25859, -0.00111,  # LowerLeg_L
    0.81234, 0.04301, -0.57691, -0.07375,  # Foot_L
    0.9895, -1e-5, -0.14452, 0.0,  # Toes_L
    0.25468, 0.96571, -0.00278, 0.05041,  # UpperLeg_R
    0.97302, 0.00366, 0.2307, -0.00084,  # LowerLeg_R
    0.79439, 0.17336, -0.58145, -0.02841,  # Foot_R
    0.98952, -1e-5, -0.14439, 0.0,  # Toes_R
]

# Frame 98 of the clip.
[[sets]]
name = "tired-again"
next = "tired-down"
# As long as in the clip.
frames = 19
# Soft: what follows may begin so many frames earlier.
drop_frames = 2

[[sets.keyframes]]
pivot = true
place_m = [0.0013, 1.3827]
heading_deg = 178.83
height_m = 0.9055
from_ground = true
rotations = [
    0.71912, -0.06858, 0.07171, 0.68777,  # Hips
    0.71483, 0.69511, -0.0241, 0.07261,  # Spine
    0.99487, -0.02784, 0.06848, 0.06909,  # Chest
    0.97803, -0.09705, 0.03004, 0.18202,  # Neck
    0.97541, -0.13945, 0.15684, 0.06732,  # Head
    0.61541, -0.41059, -0.37342, -0.55968,  # Shoulder_L
    0.77813, -0.57529, -0.23201, -0.09859,  # UpperArm_L
    0.96146, 0.16334, -0.21804, 0.03704,  # LowerArm_L
    0.99463, 0.04386, 0.02129, 0.09127,  # Hand_L
    0.59412, 0.48206, -0.40572, 0.50003,  # Shoulder_R
    0.8312, 0.16418, -0.19509, -0.49406,  # UpperArm_R
    0.9864, 0.06759, -0.14949, 0.01023,  # LowerArm_R
    0.99251, 0.04844, -0.01159, 0.11156,  # Hand_R
    0.10723, 0.00856, 0.09482, -0.98967,  # UpperLeg_L
    0.96514, 0.00399, 0.26169, -0.00108,  # LowerLeg_L
    0.81432, 0.04689, -0.57408, -0.07154,  # Foot_L
    0.9895, -1e-5, -0.14451, 0.0,  # Toes_L
    0.24104, 0.96922, -0.00668, 0.0497,  # UpperLeg_R
    0.97121, 0.00329, 0.2382, -0.00078,  # LowerLeg_R
    0.79719, 0.16828, -0.57921, -0.02609,  # Foot_R
    0.9895, -1e-5, -0.14453, 0.0,  # Toes_R
]

# Frame 175 of the clip.
[[sets]]
name = "tired-down"
# Soft: what follows may begin so many frames earlier.
drop_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [-0.0116, 1.3869]
heading_deg = 172.86
height_m = 0.9057
from_ground = true
rotations = [
    0.72932, -0.06477, 0.06972, 0.67752,  # Hips
    0.71575, 0.69333, -0.03889, 0.07409,  # Spine
    0.99401, -0.03164, 0.04967, 0.09205,  # Chest
    0.97913, -0.09583, 0.03933, 0.17483,  # Neck
    0.9845, -0.12249, 0.11565, 0.04887,  # Head
    0.55902, -0.40011, -0.42268, -0.59055,  # Shoulder_L
    0.79683, 0.20109, -0.27645, -0.4982,  # UpperArm_L
    0.92475, 0.25838, -0.26911, 0.07519,  # LowerArm_L
    0.99866, 0.04654, -0.0162, -0.0159,  # Hand_L
    0.59901, 0.48213, -0.40086, 0.49804,  # Shoulder_R
    0.81624, 0.17562, -0.22253, -0.50338,  # UpperArm_R
    0.98462, 0.05281, -0.16631, 0.00891,  # LowerArm_R
    0.99261, 0.04867, -0.01335, 0.11034,  # Hand_R
    0.11731, 0.00207, 0.12098, -0.9857,  # UpperLeg_L
    0.96195, 0.00412, 0.2732, -0.00117,  # LowerLeg_L
    0.81026, 0.02645, -0.58277, -0.05621,  # Foot_L
    0.98949, -1e-5, -0.14457, 0.0,  # Toes_L
    0.2104, 0.97679, 0.00564, 0.03971,  # UpperLeg_R
    0.97112, 0.003, 0.23856, -0.00071,  # LowerLeg_R
    0.7998, 0.18316, -0.57039, -0.03781,  # Foot_R
    0.98921, -6e-5, -0.1465, 1e-5,  # Toes_R
]

# Variant both, made from dataset-2_wave-both-hands_masculine_001.bvh, frames 29, 46, 66, 89, 210, for pack human; the poses are under the clip's licence.

[[variants]]
name = "both"
weight = 0.5
entry = "both-in"

# Frame 29 of the clip.
[[sets]]
name = "both-in"
next = "both-out"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.4]
heading_deg = 180.0
height_m = 0.9213
from_ground = true
rotations = [
    0.7181, -0.03769, 0.03901, 0.69382,  # Hips
    0.71182, 0.70215, -0.00672, 0.01569,  # Spine
    0.99918, -0.01368, 0.01269, -0.03606,  # Chest
    0.99994, -0.01068, 0.00271, -0.00179,  # Neck
    0.99926, -0.00966, 0.00323, -0.03721,  # Head
    0.67789, -0.42384, -0.31845, -0.50933,  # Shoulder_L
    0.54413, -0.58069, -0.59934, 0.08667,  # UpperArm_L
    0.8905, 0.01858, -0.45451, 0.00948,  # LowerArm_L
    0.98689, 0.05952, -0.08005, 0.1269,  # Hand_L
    0.52182, 0.33047, -0.42077, 0.66442,  # Shoulder_R
    0.42987, -0.60767, -0.65761, 0.11617,  # UpperArm_R
    0.92628, -0.02797, -0.37562, -0.01135,  # LowerArm_R
    0.9831, 0.05961, -0.06411, 0.16076,  # Hand_R
    0.10114, -0.02167, 0.14404, -0.98415,  # UpperLeg_L
    0.98244, 0.00369, 0.18655, -0.0007,  # LowerLeg_L
    0.85472, -0.03629, -0.5157, -0.04682,  # Foot_L
    0.9895, -1e-5, -0.14455, 0.0,  # Toes_L
    0.1863, 0.98117, -0.05078, 0.00336,  # UpperLeg_R
    0.98415, -0.00058, 0.17733, 0.00013,  # LowerLeg_R
    0.84945, 0.00017, -0.52755, -0.01103,  # Foot_R
    0.98571, -0.00061, -0.16847, 5e-5,  # Toes_R
]

# Frame 46 of the clip.
[[sets]]
name = "both-out"
next = "both-back"
# As long as in the clip.
frames = 17
# Soft: what follows may begin so many frames earlier.
drop_frames = 2

[[sets.keyframes]]
pivot = true
place_m = [-0.0046, 1.4076]
heading_deg = -179.93
height_m = 0.9199
from_ground = true
rotations = [
    0.71487, -0.04127, 0.04234, 0.69675,  # Hips
    0.71121, 0.70271, -0.01161, 0.0156,  # Spine
    0.99948, -0.01203, 0.00565, -0.02928,  # Chest
    0.99981, -0.01387, 0.01008, -0.00961,  # Neck
    0.99966, -0.00964, 0.00042, -0.02436,  # Head
    0.62273, -0.41915, -0.36892, -0.5481,  # Shoulder_L
    0.85557, -0.44613, -0.02082, -0.26178,  # UpperArm_L
    0.94412, -0.02783, -0.32829, -0.00968,  # LowerArm_L
    0.98836, 0.05819, -0.07632, 0.11805,  # Hand_L
    0.58079, 0.38336, -0.39561, 0.59934,  # Shoulder_R
    0.84833, -0.4752, -0.15446, -0.17511,  # UpperArm_R
    0.97133, -0.07301, -0.2256, -0.01697,  # LowerArm_R
    0.98979, 0.04976, -0.01708, 0.13246,  # Hand_R
    0.09524, -0.02648, 0.1458, -0.98436,  # UpperLeg_L
    0.98024, 0.00369, 0.19779, -0.00074,  # LowerLeg_L
    0.85402, -0.0317, -0.5174, -0.04402,  # Foot_L
    0.98951, -1e-5, -0.14449, 0.0,  # Toes_L
    0.17836, 0.98215, -0.05969, -0.00129,  # UpperLeg_R
    0.98258, 0.00042, 0.18584, -5e-5,  # LowerLeg_R
    0.84963, -0.01208, -0.52646, -0.0287,  # Foot_R
    0.98414, -0.00083, -0.1774, 7e-5,  # Toes_R
]

# Frame 66 of the clip.
[[sets]]
name = "both-back"
next = "both-again"
# As long as in the clip.
frames = 20

[[sets.keyframes]]
pivot = true
place_m = [-0.0011, 1.4033]
heading_deg = -178.54
height_m = 0.9202
from_ground = true
rotations = [
    0.71549, -0.04289, 0.0441, 0.69591,  # Hips
    0.71056, 0.70335, -0.01091, 0.01683,  # Spine
    0.99951, -0.01018, 0.00837, -0.02854,  # Chest
    0.99988, -0.0135, 0.00107, -0.0075,  # Neck
    0.99928, -0.01575, 1e-5, -0.03452,  # Head
    0.67642, -0.41734, -0.31865, -0.51648,  # Shoulder_L
    0.5333, -0.59569, -0.59326, 0.09376,  # UpperArm_L
    0.88467, 0.01237, -0.46601, 0.00652,  # LowerArm_L
    0.98749, 0.05932, -0.08253, 0.12055,  # Hand_L
    0.52876, 0.3327, -0.41585, 0.66091,  # Shoulder_R
    0.40851, -0.61724, -0.66226, 0.11636,  # UpperArm_R
    0.92355, -0.03831, -0.38123, -0.01582,  # LowerArm_R
    0.98845, 0.0547, -0.04669, 0.13336,  # Hand_R
    0.0977, -0.02152, 0.13737, -0.98546,  # UpperLeg_L
    0.98107, 0.00367, 0.1936, -0.00073,  # LowerLeg_L
    0.85457, -0.02892, -0.51631, -0.04786,  # Foot_L
    0.9895, -1e-5, -0.14452, 0.0,  # Toes_L
    0.18663, 0.98081, -0.05629, 0.00453,  # UpperLeg_R
    0.98214, -0.00066, 0.18815, 0.00015,  # LowerLeg_R
    0.847, -0.00879, -0.53148, -0.00686,  # Foot_R
    0.98502, -0.0007, -0.17242, 6e-5,  # Toes_R
]

# Frame 89 of the clip.
[[sets]]
name = "both-again"
next = "both-down"
# As long as in the clip.
frames = 23
# Soft: what follows may begin so many frames earlier.
drop_frames = 2

[[sets.keyframes]]
pivot = true
place_m = [-0.0044, 1.4032]
heading_deg = -179.75
height_m = 0.9187
from_ground = true
rotations = [
    0.71443, -0.04398, 0.04508, 0.69687,  # Hips
    0.71, 0.70373, -0.01826, 0.01803,  # Spine
    0.99983, -0.00887, -0.00032, -0.01645,  # Chest
    0.99975, -0.01739, 0.0094, -0.01078,  # Neck
    0.9995, -0.01669, 0.00169, -0.02691,  # Head
    0.62536, -0.40768, -0.36337, -0.55739,  # Shoulder_L
    0.84323, -0.44624, -0.02536, -0.29864,  # UpperArm_L
    0.94059, -0.03103, -0.33795, -0.01115,  # LowerArm_L
    0.98638, 0.05926, -0.07429, 0.13422,  # Hand_L
    0.58886, 0.37923, -0.38645, 0.60007,  # Shoulder_R
    0.83812, -0.47745, -0.12721, -0.23111,  # UpperArm_R
    0.96122, -0.06904, -0.26632, -0.01914,  # LowerArm_R
    0.98613, 0.04869, -0.00803, 0.15844,  # Hand_R
    0.0959, -0.02254, 0.14218, -0.98493,  # UpperLeg_L
    0.97919, 0.00392, 0.20289, -0.00081,  # LowerLeg_L
    0.85126, -0.03372, -0.52177, -0.04437,  # Foot_L
    0.9895, -1e-5, -0.14455, 0.0,  # Toes_L
    0.18217, 0.98127, -0.06264, 0.0022,  # UpperLeg_R
    0.98139, 0.00068, 0.19204, -0.00011,  # LowerLeg_R
    0.84659, -0.00831, -0.53147, -0.02744,  # Foot_R
    0.98522, -0.00068, -0.17129, 6e-5,  # Toes_R
]

# Frame 210 of the clip.
[[sets]]
name = "both-down"
# Soft: what follows may begin so many frames earlier.
drop_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [-0.0044, 1.3965]
heading_deg = 179.66
height_m = 0.9209
from_ground = true
rotations = [
    0.71985, -0.0226, 0.02346, 0.69337,  # Hips
    0.70954, 0.70352, -0.02484, 0.03162,  # Spine
    0.99984, -0.00851, 0.0096, 0.0121,  # Chest
    0.99968, -0.01326, 0.00831, 0.01996,  # Neck
    0.99963, -0.0081, -0.00438, 0.02557,  # Head
    0.57992, -0.40774, -0.40566, -0.57696,  # Shoulder_L
    0.79811, 0.23538, -0.23203, -0.50377,  # UpperArm_L
    0.92861, 0.02425, -0.37013, 0.00967,  # LowerArm_L
    0.9923, 0.05173, -0.1105, 0.02115,  # Hand_L
    0.60317, 0.42385, -0.38848, 0.55283,  # Shoulder_R
    0.81563, 0.23586, -0.23729, -0.47202,  # UpperArm_R
    0.92047, -0.02085, -0.39017, -0.00884,  # LowerArm_R
    0.99603, 0.04862, -0.07461, 0.00126,  # Hand_R
    0.09753, -0.04397, 0.14501, -0.98363,  # UpperLeg_L
    0.98121, 0.00408, 0.19291, -0.0008,  # LowerLeg_L
    0.85167, -0.03858, -0.5208, -0.04397,  # Foot_L
    0.9895, -1e-5, -0.14451, 0.0,  # Toes_L
    0.1891, 0.98054, -0.0519, -0.00946,  # UpperLeg_R
    0.98655, 0.00213, 0.16345, -0.00033,  # LowerLeg_R
    0.85251, -0.00696, -0.52057, -0.04682,  # Foot_R
    0.98595, -0.00057, -0.16707, 5e-5,  # Toes_R
]
`],[`seat.toml`,`# seat, made from dataset-1_bow_normal_001.bvh, frames 2, 4, 6, for pack human; the poses are under the clip's licence.
# Metres, degrees about +Y, rotations as w, x, y, z. docs/objects.md explains the fields.

format = 1
name = "seat"
description = "A stool of 0.45 m to sit on."

[shape.box]
center_m = [0.0, 0.225, 0.0]
half_extents_m = [0.225, 0.225, 0.225]

# How near a character must be, metres from the shape.
[trigger]
reach_m = 0.9

# The side that a character comes from, degrees from the object's +Z, and how far from its pivot it starts.
[[approaches]]
name = "front"
directions_deg = [-60.0, 60.0]
distance_m = 0.81

[[variants]]
name = "upright"
entry = "turn"
exit = "rise"

# Frame 2 of the clip.
[[sets]]
name = "turn"
next = "sit"
# A character that comes for it stops first.
from_stand = true

[[sets.keyframes]]
place_m = [-0.0009, 0.4075]
heading_deg = -0.1
height_m = 0.9402
from_ground = true
rotations = [
    0.70556, 0.00279, -0.00277, 0.70864,  # Hips
    0.69462, 0.71861, 0.03295, -0.00427,  # Spine
    0.99962, 0.01704, -0.00645, -0.02075,  # Chest
    0.99913, 0.03728, -0.00349, -0.0182,  # Neck
    0.99885, 0.04244, -0.00315, 0.0219,  # Head
    0.48106, -0.45612, -0.5194, -0.53923,  # Shoulder_L
    0.78337, -0.18858, 0.19724, -0.55845,  # UpperArm_L
    0.97965, 0.0, -0.20071, 0.0,  # LowerArm_L
    0.90595, 0.41303, 0.0436, 0.08216,  # Hand_L
    0.55669, 0.52227, -0.43724, 0.47555,  # Shoulder_R
    0.82252, -0.04808, 0.12007, -0.55384,  # UpperArm_R
    0.97242, 0.0, -0.23322, 1e-5,  # LowerArm_R
    0.95479, 0.28274, 0.0605, 0.06914,  # Hand_R
    0.00568, 0.01584, -0.04257, 0.99895,  # UpperLeg_L
    0.99976, 0.0, 0.02193, 0.0,  # LowerLeg_L
    0.89672, -0.08204, -0.43292, 0.04177,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    0.1285, -0.99099, -0.03327, -0.01806,  # UpperLeg_R
    0.99917, 0.0, 0.04079, 0.0,  # LowerLeg_R
    0.8268, -0.27964, -0.4638, 0.15194,  # Foot_R
    0.989, 0.0, -0.14791, 0.0,  # Toes_R
]

# Frame 4 of the clip.
[[sets]]
name = "sit"
# Without the networks, the feet held where they stand.
motion = "stance"
hold_until_ended = true

[[sets.keyframes]]
place_m = [0.0, 0.0]
heading_deg = 0.0
height_m = 0.55
from_ground = true
rotations = [
    0.70486, 0.02616, -0.02603, 0.70838,  # Hips
    0.69592, 0.7178, 0.02083, 0.00444,  # Spine
    0.99986, 0.01538, -0.00391, -0.00541,  # Chest
    0.99875, 0.03582, -0.00179, -0.03494,  # Neck
    0.99904, 0.04213, -0.00588, 0.01023,  # Head
    0.47938, -0.4586, -0.52157, -0.53652,  # Shoulder_L
    0.75403, -0.25968, 0.06876, -0.59939,  # UpperArm_L
    0.82737, 0.0, -0.29466, -0.47815,  # LowerArm_L
    0.88332, 0.46419, 0.05761, 0.03076,  # Hand_L
    0.55545, 0.5241, -0.43832, 0.47399,  # Shoulder_R
    0.7798, -0.06566, -0.05148, -0.62044,  # UpperArm_R
    0.81358, 0.0, -0.49776, -0.30055,  # LowerArm_R
    0.95739, 0.27993, 0.06667, 0.02439,  # Hand_R
    0.03009, 0.73127, -0.04851, 0.67969,  # UpperLeg_L
    0.72441, -2e-5, 0.68821, 0.03995,  # LowerLeg_L
    0.91001, -0.06919, -0.40404, 0.062,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    0.09491, -0.67395, -0.03762, 0.73169,  # UpperLeg_R
    0.65853, 0.0, 0.75243, -0.01342,  # LowerLeg_R
    0.83894, -0.28245, -0.45723, 0.08571,  # Foot_R
    0.98852, 0.0, -0.15106, 0.0,  # Toes_R
]

# Frame 6 of the clip.
[[sets]]
name = "rise"
# Without the networks, the feet held where they stand.
motion = "stance"

[[sets.keyframes]]
place_m = [0.0011, 0.4111]
heading_deg = 0.15
height_m = 0.941
from_ground = true
rotations = [
    0.70482, 0.01095, -0.01089, 0.70922,  # Hips
    0.69755, 0.71611, 0.02424, -0.00416,  # Spine
    0.99982, 0.01318, -0.00136, -0.01369,  # Chest
    0.99822, 0.03552, -0.00052, -0.04789,  # Neck
    0.99906, 0.04267, -0.00739, 0.0003,  # Head
    0.47936, -0.46206, -0.52201, -0.53313,  # Shoulder_L
    0.78492, -0.07447, 0.11657, -0.60396,  # UpperArm_L
    0.89397, 0.0, -0.44812, 0.0,  # LowerArm_L
    0.86078, 0.49752, 0.08416, -0.06665,  # Hand_L
    0.55382, 0.52479, -0.4399, 0.47368,  # Shoulder_R
    0.82787, 0.12088, -0.03026, -0.54691,  # UpperArm_R
    0.91875, 0.0, -0.39484, 1e-5,  # LowerArm_R
    0.95936, 0.27224, 0.06365, -0.03815,  # Hand_R
    0.0084, 0.02532, -0.05913, 0.99789,  # UpperLeg_L
    0.99976, 0.0, 0.02193, 0.0,  # LowerLeg_L
    0.89826, -0.06462, -0.4333, 0.03467,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    0.12675, -0.99144, -0.03007, -0.00913,  # UpperLeg_R
    0.99917, 0.0, 0.04079, 0.0,  # LowerLeg_R
    0.82571, -0.28025, -0.46576, 0.15076,  # Foot_R
    0.98822, 0.0, -0.15304, 0.0,  # Toes_R
]

# Variant bent, made from dataset-1_bow_old_001.bvh, frames 2, 4, 6, for pack human; the poses are under the clip's licence.

[[variants]]
name = "bent"
entry = "bent-turn"
exit = "bent-rise"

# Frame 2 of the clip.
[[sets]]
name = "bent-turn"
next = "bent-sit"
# A character that comes for it stops first.
from_stand = true

[[sets.keyframes]]
place_m = [0.0045, 0.3436]
heading_deg = -0.35
height_m = 0.9228
from_ground = true
rotations = [
    0.70771, 0.01276, -0.01278, 0.70627,  # Hips
    0.71197, 0.69979, -0.04844, 0.03236,  # Spine
    0.99851, -0.0172, -0.02273, 0.04655,  # Chest
    0.9987, -0.03362, 0.02194, -0.03144,  # Neck
    0.9962, -0.01916, 0.01928, -0.08275,  # Head
    0.48178, -0.49693, -0.51253, -0.5082,  # Shoulder_L
    0.73418, 0.32783, -0.26034, -0.53453,  # UpperArm_L
    0.79649, -0.08214, -0.59589, -0.06146,  # LowerArm_L
    0.99302, 0.05263, -0.04727, 0.09433,  # Hand_L
    0.52222, 0.55409, -0.49057, 0.4238,  # Shoulder_R
    0.76833, 0.32424, -0.14292, -0.53302,  # UpperArm_R
    0.7558, 0.01641, -0.65445, 0.0142,  # LowerArm_R
    0.99356, 0.04434, -0.02999, -0.09983,  # Hand_R
    0.0244, -0.13847, 0.03848, -0.98932,  # UpperLeg_L
    0.97984, -0.00026, 0.19979, 0.00012,  # LowerLeg_L
    0.86817, -0.00779, -0.49611, -0.01,  # Foot_L
    0.98922, -0.00011, -0.14642, 0.0001,  # Toes_L
    -0.07331, -0.98761, 0.06427, 0.12293,  # UpperLeg_R
    0.98721, 0.00025, 0.1594, 6e-5,  # LowerLeg_R
    0.88144, -0.02002, -0.46951, -0.04715,  # Foot_R
    0.98768, -0.00109, -0.15649, 0.00131,  # Toes_R
]

# Frame 4 of the clip.
[[sets]]
name = "bent-sit"
# Without the networks, the feet held where they stand.
motion = "stance"
hold_until_ended = true

[[sets.keyframes]]
place_m = [0.0, 0.0]
heading_deg = 0.0
height_m = 0.55
from_ground = true
rotations = [
    0.7067, 0.03061, -0.03064, 0.70618,  # Hips
    0.71069, 0.69989, -0.05745, 0.04212,  # Spine
    0.99773, -0.01505, -0.02186, 0.06186,  # Chest
    0.99877, -0.03316, 0.02087, -0.03043,  # Neck
    0.99614, -0.0195, 0.02096, -0.08293,  # Head
    0.48177, -0.49604, -0.51227, -0.50933,  # Shoulder_L
    0.79407, 0.26474, -0.28304, -0.46824,  # UpperArm_L
    0.71476, -0.07247, -0.66639, 0.19948,  # LowerArm_L
    0.99365, 0.05192, -0.04332, 0.08995,  # Hand_L
    0.52186, 0.55445, -0.49085, 0.42346,  # Shoulder_R
    0.79497, 0.24312, -0.23802, -0.50226,  # UpperArm_R
    0.73328, 0.01333, -0.60473, 0.31053,  # LowerArm_R
    0.99353, 0.04412, -0.03355, -0.09912,  # Hand_R
    0.03341, -0.73502, 0.01176, -0.67712,  # UpperLeg_L
    0.69353, -0.00016, 0.72042, 0.00038,  # LowerLeg_L
    0.89575, -0.0129, -0.44434, -0.0044,  # Foot_L
    0.98917, -0.00013, -0.14677, 0.00012,  # Toes_L
    -0.02096, -0.67897, 0.08293, 0.72916,  # UpperLeg_R
    0.70402, 7e-5, 0.71018, 0.00026,  # LowerLeg_R
    0.90058, -0.02717, -0.43264, -0.03231,  # Foot_R
    0.98784, -0.001, -0.15547, 0.0012,  # Toes_R
]

# Frame 6 of the clip.
[[sets]]
name = "bent-rise"
# Without the networks, the feet held where they stand.
motion = "stance"

[[sets.keyframes]]
place_m = [-0.0068, 0.3423]
heading_deg = 0.37
height_m = 0.9223
from_ground = true
rotations = [
    0.70662, 0.01065, -0.01064, 0.70744,  # Hips
    0.71103, 0.70044, -0.05033, 0.03602,  # Spine
    0.9982, -0.01496, -0.02022, 0.0544,  # Chest
    0.99877, -0.03324, 0.02156, -0.02984,  # Neck
    0.99585, -0.01913, 0.02353, -0.08586,  # Head
    0.48114, -0.49573, -0.51264, -0.50986,  # Shoulder_L
    0.73776, 0.33047, -0.25726, -0.52945,  # UpperArm_L
    0.78751, -0.07941, -0.60808, -0.06132,  # LowerArm_L
    0.99421, 0.05139, -0.04087, 0.085,  # Hand_L
    0.52187, 0.55454, -0.49084, 0.42333,  # Shoulder_R
    0.76902, 0.32767, -0.14715, -0.52877,  # UpperArm_R
    0.75193, 0.01041, -0.65909, 0.00912,  # LowerArm_R
    0.99322, 0.04386, -0.03617, -0.10143,  # Hand_R
    0.02893, -0.13629, 0.02813, -0.98985,  # UpperLeg_L
    0.98012, -0.00024, 0.19839, 0.00011,  # LowerLeg_L
    0.86927, -0.01303, -0.49396, -0.01451,  # Foot_L
    0.98915, -0.00014, -0.14691, 0.00012,  # Toes_L
    -0.07271, -0.98742, 0.05985, 0.12702,  # UpperLeg_R
    0.98465, -2e-5, 0.17457, 0.00012,  # LowerLeg_R
    0.87765, -0.02336, -0.47716, -0.03865,  # Foot_R
    0.988, -0.00091, -0.15444, 0.00109,  # Toes_R
]
`],[`shrine.toml`,`# shrine, made from dataset-1_bow_normal_001.bvh, frames 30, 62, 112, 130, for pack human; the poses are under the clip's licence.
# Metres, degrees about +Y, rotations as w, x, y, z. docs/objects.md explains the fields.

format = 1
name = "shrine"
description = "A place to bow at, from any side."
# Any number of characters may use it at once.
shared = true

[shape.box]
center_m = [0.0, 0.6, 0.0]
half_extents_m = [0.4, 0.6, 0.25]

# How near a character must be, metres from the shape.
[trigger]
reach_m = 1.6

[[variants]]
name = "polite"
entry = "stand"

# Frame 30 of the clip.
[[sets]]
name = "stand"
next = "bow"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.1]
heading_deg = 180.0
height_m = 0.9384
from_ground = true
rotations = [
    0.70182, 0.02636, -0.026, 0.71139,  # Hips
    0.69808, 0.71588, 0.00627, 0.01297,  # Spine
    0.99975, 0.01247, 0.00342, -0.01807,  # Chest
    0.99869, 0.03394, -0.01017, -0.037,  # Neck
    0.99877, 0.02967, -0.01345, 0.03745,  # Head
    0.48378, -0.48217, -0.51917, -0.51375,  # Shoulder_L
    0.78124, 0.50541, -0.2819, -0.23399,  # UpperArm_L
    0.67661, 0.0, -0.73634, 0.0,  # LowerArm_L
    0.97231, 0.00249, -0.09854, 0.21191,  # Hand_L
    0.53302, 0.52458, -0.46088, 0.47781,  # Shoulder_R
    0.76197, 0.49662, -0.36509, -0.19871,  # UpperArm_R
    0.67194, 0.0, -0.7406, 1e-5,  # LowerArm_R
    0.90786, 0.40015, -0.11608, -0.04685,  # Hand_R
    0.02137, 0.05862, -0.05221, 0.99669,  # UpperLeg_L
    0.99931, 0.0, 0.03722, 0.0,  # LowerLeg_L
    0.89511, -0.05444, -0.44072, 0.03975,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    -0.12704, 0.99125, 0.01841, -0.03084,  # UpperLeg_R
    0.99728, 0.0, 0.07367, 0.0,  # LowerLeg_R
    0.81592, -0.29792, -0.47392, 0.14464,  # Foot_R
    0.98928, 0.0, -0.14603, 0.0,  # Toes_R
]

# Frame 62 of the clip.
[[sets]]
name = "bow"
next = "rise"
# As long as in the clip.
frames = 32
hold_frames = 15

[[sets.keyframes]]
pivot = true
place_m = [-0.0039, 1.1713]
heading_deg = -179.51
height_m = 0.9302
from_ground = true
rotations = [
    0.70484, 0.15571, -0.16319, 0.67255,  # Hips
    0.69338, 0.70546, -0.10999, 0.09721,  # Spine
    0.99853, 0.00913, 0.00356, 0.05333,  # Chest
    0.99413, 0.01923, -0.01093, 0.10586,  # Neck
    0.9992, -0.00196, -0.00541, 0.03952,  # Head
    0.47397, -0.47046, -0.52886, -0.52376,  # Shoulder_L
    0.85764, 0.39302, -0.18723, -0.27373,  # UpperArm_L
    0.5918, 0.0, -0.80609, 0.0,  # LowerArm_L
    0.96752, 0.1816, -0.09256, 0.14955,  # Hand_L
    0.5381, 0.5302, -0.45516, 0.47134,  # Shoulder_R
    0.82507, 0.40662, -0.32689, -0.21695,  # UpperArm_R
    0.59737, 0.0, -0.80196, 1e-5,  # LowerArm_R
    0.83517, 0.53436, -0.08127, -0.10169,  # Hand_R
    0.00227, 0.33431, -0.04517, 0.94138,  # UpperLeg_L
    0.99328, 0.0, 0.11576, 0.0,  # LowerLeg_L
    0.90155, -0.05419, -0.42664, 0.04747,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    0.1472, -0.94312, -0.01679, 0.29762,  # UpperLeg_R
    0.99124, 0.0, 0.1321, 0.0,  # LowerLeg_R
    0.82112, -0.31875, -0.45069, 0.14506,  # Foot_R
    0.99001, 0.0, -0.14103, 0.0,  # Toes_R
]

# Frame 112 of the clip.
[[sets]]
name = "rise"
next = "loose"
# As long as in the clip.
frames = 50

[[sets.keyframes]]
pivot = true
place_m = [0.0001, 1.1076]
heading_deg = 178.84
height_m = 0.94
from_ground = true
rotations = [
    0.7084, 0.02308, -0.02319, 0.70506,  # Hips
    0.69305, 0.72066, 0.01833, -0.00011,  # Spine
    0.99979, 0.01956, 0.00591, -0.00328,  # Chest
    0.99929, 0.03711, -0.00146, -0.0057,  # Neck
    0.99989, 0.00409, -0.01207, 0.00706,  # Head
    0.48366, -0.46586, -0.51777, -0.53005,  # Shoulder_L
    0.80649, 0.26939, -0.04759, -0.52416,  # UpperArm_L
    0.66476, 0.0, -0.74706, 0.0,  # LowerArm_L
    0.91033, 0.39122, -0.12733, -0.04507,  # Hand_L
    0.5477, 0.52133, -0.44639, 0.47852,  # Shoulder_R
    0.8078, 0.41004, -0.23964, -0.34913,  # UpperArm_R
    0.66065, 0.0, -0.7507, 1e-5,  # LowerArm_R
    0.89029, 0.43572, -0.08252, -0.10359,  # Hand_R
    0.0118, 0.05652, -0.04999, 0.99708,  # UpperLeg_L
    0.99947, 0.0, 0.03253, 0.0,  # LowerLeg_L
    0.89652, -0.06558, -0.43578, 0.0453,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    -0.12595, 0.9916, 0.02452, -0.01637,  # UpperLeg_R
    0.99915, 0.0, 0.04115, 0.0,  # LowerLeg_R
    0.82948, -0.28527, -0.4578, 0.1449,  # Foot_R
    0.98982, 0.0, -0.14236, 0.0,  # Toes_R
]

# Frame 130 of the clip.
[[sets]]
name = "loose"
# As long as in the clip.
frames = 18
# Soft: what follows may begin so many frames earlier.
drop_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [0.0139, 1.1018]
heading_deg = 177.47
height_m = 0.94
from_ground = true
rotations = [
    0.70604, -0.00099, 0.00099, 0.70817,  # Hips
    0.6971, 0.71596, 0.03324, -0.01845,  # Spine
    0.99976, 0.01339, 0.00485, -0.01677,  # Chest
    0.99795, 0.05227, -0.00322, 0.03681,  # Neck
    0.99757, 0.0088, 0.00098, 0.06913,  # Head
    0.48342, -0.45485, -0.51662, -0.54085,  # Shoulder_L
    0.78603, -0.18333, 0.20912, -0.55211,  # UpperArm_L
    0.98178, 0.0, -0.19003, 0.0,  # LowerArm_L
    0.89176, 0.43933, 0.00593, 0.10822,  # Hand_L
    0.55833, 0.52073, -0.43572, 0.47671,  # Shoulder_R
    0.82858, -0.05336, 0.16381, -0.5327,  # UpperArm_R
    0.95481, 0.0, -0.29722, 1e-5,  # LowerArm_R
    0.9283, 0.3548, 0.01002, 0.11077,  # Hand_R
    0.00553, 0.01178, -0.04399, 0.99895,  # UpperLeg_L
    0.99976, 0.0, 0.02193, 0.0,  # LowerLeg_L
    0.89551, -0.08573, -0.4344, 0.04478,  # Foot_L
    0.98955, 0.0, -0.14416, 0.0,  # Toes_L
    0.12534, -0.99133, -0.03286, -0.02157,  # UpperLeg_R
    0.99917, 0.0, 0.04079, 0.0,  # LowerLeg_R
    0.83039, -0.27221, -0.46325, 0.14747,  # Foot_R
    0.98959, 0.0, -0.14392, 0.0,  # Toes_R
]

# Variant deep, made from dataset-1_bow_active_001.bvh, frames 26, 48, 84, for pack human; the poses are under the clip's licence.

[[variants]]
name = "deep"
entry = "deep-stand"

# Frame 26 of the clip.
[[sets]]
name = "deep-stand"
next = "deep-bow"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.1]
heading_deg = 180.0
height_m = 0.9393
from_ground = true
rotations = [
    0.70655, 0.02552, -0.02552, 0.70674,  # Hips
    0.70886, 0.70457, -0.02195, 0.02506,  # Spine
    0.99997, -0.00607, 0.0044, -0.00127,  # Chest
    0.99402, -0.01995, -0.00304, -0.10735,  # Neck
    0.99882, -0.02583, -0.00654, 0.04053,  # Head
    0.41626, -0.5353, -0.57031, -0.4636,  # Shoulder_L
    0.66807, 0.38671, -0.36476, -0.52067,  # UpperArm_L
    0.90632, -0.15515, -0.38746, -0.06633,  # LowerArm_L
    0.995, 0.04424, -0.04663, -0.07644,  # Hand_L
    0.44977, 0.58136, -0.54514, 0.40319,  # Shoulder_R
    0.71122, 0.30581, -0.30529, -0.55448,  # UpperArm_R
    0.89279, 0.12581, -0.42832, 0.06035,  # LowerArm_R
    0.99589, 0.0466, -0.07335, -0.02547,  # Hand_R
    0.03538, -0.02544, -0.00519, -0.99904,  # UpperLeg_L
    1.0, -0.00031, 0.00071, 0.0,  # LowerLeg_L
    0.89834, -0.01729, -0.43821, -0.02582,  # Foot_L
    0.99039, 0.0003, -0.13831, -0.00026,  # Toes_L
    -0.15526, -0.98748, 0.00648, 0.02701,  # UpperLeg_R
    0.99974, -0.00011, 0.02272, 5e-5,  # LowerLeg_R
    0.89172, 0.03424, -0.45079, -0.02121,  # Foot_R
    0.98926, 0.00039, -0.14614, -0.00091,  # Toes_R
]

# Frame 48 of the clip.
[[sets]]
name = "deep-bow"
next = "deep-rise"
# As long as in the clip.
frames = 22
hold_frames = 25

[[sets.keyframes]]
pivot = true
place_m = [-0.0209, 1.2976]
heading_deg = 178.76
height_m = 0.9346
from_ground = true
rotations = [
    0.64139, 0.30844, -0.31509, 0.62785,  # Hips
    0.70515, 0.70346, -0.05727, 0.06805,  # Spine
    0.99387, -0.00238, 0.01522, 0.10946,  # Chest
    0.99292, -0.01101, -0.0081, 0.11796,  # Neck
    0.99357, -0.01311, -0.0027, 0.11247,  # Head
    0.43665, -0.50109, -0.54759, -0.50832,  # Shoulder_L
    0.72295, 0.35213, -0.34953, -0.48081,  # UpperArm_L
    0.84402, 0.0073, -0.53624, 0.00464,  # LowerArm_L
    0.99851, 0.04739, -0.02366, 0.01295,  # Hand_L
    0.4916, 0.56195, -0.51402, 0.42228,  # Shoulder_R
    0.75828, 0.27813, -0.23791, -0.53949,  # UpperArm_R
    0.75476, 0.2246, -0.59076, 0.17579,  # LowerArm_R
    0.99791, 0.04822, -0.02898, 0.03172,  # Hand_R
    0.05108, -0.54148, -0.01239, -0.83907,  # UpperLeg_L
    1.0, 0.00016, 0.0008, -8e-5,  # LowerLeg_L
    0.94254, -0.05099, -0.32974, -0.01701,  # Foot_L
    0.99039, 0.0003, -0.1383, -0.00026,  # Toes_L
    0.13173, 0.83325, 0.07431, -0.5318,  # UpperLeg_R
    1.0, -0.00025, 0.00061, 2e-5,  # LowerLeg_R
    0.94481, 0.04167, -0.32455, -0.01612,  # Foot_R
    0.99151, 0.00124, -0.13, -0.00149,  # Toes_R
]

# Frame 84 of the clip.
[[sets]]
name = "deep-rise"
# As long as in the clip.
frames = 36
# Soft: what follows may begin so many frames earlier.
drop_frames = 8

[[sets.keyframes]]
pivot = true
place_m = [-0.0119, 1.1102]
heading_deg = 176.2
height_m = 0.9373
from_ground = true
rotations = [
    0.70619, 0.01306, -0.01303, 0.70778,  # Hips
    0.70893, 0.70381, -0.02842, 0.03546,  # Spine
    0.99967, -0.00723, 0.00994, 0.0226,  # Chest
    0.99991, -0.00011, -0.00202, -0.01289,  # Neck
    0.99979, 0.00619, -0.01745, -0.00887,  # Head
    0.42686, -0.49518, -0.55327, -0.51622,  # Shoulder_L
    0.74436, 0.36237, -0.36435, -0.42645,  # UpperArm_L
    0.84932, -0.04584, -0.52513, -0.02834,  # LowerArm_L
    0.99837, 0.04653, -0.00279, 0.03279,  # Hand_L
    0.51161, 0.56384, -0.49853, 0.4145,  # Shoulder_R
    0.76733, 0.29488, -0.33425, -0.461,  # UpperArm_R
    0.80608, 0.16572, -0.55649, 0.1144,  # LowerArm_R
    0.99815, 0.04796, -0.03331, 0.01675,  # Hand_R
    0.02656, -0.04036, 0.03136, -0.99834,  # UpperLeg_L
    0.99822, 1e-5, 0.05966, 1e-5,  # LowerLeg_L
    0.88692, -0.00663, -0.46147, -0.01931,  # Foot_L
    0.99057, 0.00036, -0.13698, -0.00032,  # Toes_L
    -0.15407, -0.98676, 0.02082, 0.04618,  # UpperLeg_R
    0.99726, 5e-5, 0.07402, 6e-5,  # LowerLeg_R
    0.88248, 0.0614, -0.46483, -0.03736,  # Foot_R
    0.98956, 0.00067, -0.1441, -0.00126,  # Toes_R
]

# Variant old, made from dataset-1_bow_old_001.bvh, frames 24, 80, 136, for pack human; the poses are under the clip's licence.

[[variants]]
name = "old"
entry = "old-stand"

# Frame 24 of the clip.
[[sets]]
name = "old-stand"
next = "old-bow"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.1]
heading_deg = 180.0
height_m = 0.925
from_ground = true
rotations = [
    0.70532, 0.04722, -0.04719, 0.70574,  # Hips
    0.70943, 0.70079, -0.05536, 0.05046,  # Spine
    0.99654, -0.0122, -0.00693, 0.08192,  # Chest
    0.99873, -0.03599, 0.02443, -0.0253,  # Neck
    0.99525, -0.01847, 0.02997, -0.09074,  # Head
    0.47992, -0.49415, -0.51306, -0.51211,  # Shoulder_L
    0.73967, 0.32687, -0.24528, -0.53468,  # UpperArm_L
    0.77544, -0.07019, -0.62496, -0.05657,  # LowerArm_L
    0.9918, 0.05352, -0.04957, 0.10492,  # Hand_L
    0.52333, 0.55403, -0.48973, 0.4235,  # Shoulder_R
    0.77413, 0.32423, -0.1425, -0.52468,  # UpperArm_R
    0.73402, 0.0254, -0.67825, 0.02346,  # LowerArm_R
    0.99417, 0.04414, -0.03737, -0.09097,  # Hand_R
    0.05205, -0.18263, 0.01923, -0.98161,  # UpperLeg_L
    0.98736, -0.00075, 0.15852, 0.00014,  # LowerLeg_L
    0.88864, -0.02113, -0.45725, -0.02815,  # Foot_L
    0.98906, -0.00017, -0.14755, 0.00015,  # Toes_L
    -0.07092, -0.97933, 0.02793, 0.18734,  # UpperLeg_R
    0.9852, -0.00077, 0.17139, 0.00022,  # LowerLeg_R
    0.88318, -0.02312, -0.46839, -0.00829,  # Foot_R
    0.98848, -0.00063, -0.15133, 0.00076,  # Toes_R
]

# Frame 80 of the clip.
[[sets]]
name = "old-bow"
next = "old-rise"
# As long as in the clip.
frames = 56
hold_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [-0.0299, 1.1799]
heading_deg = -179.84
height_m = 0.9163
from_ground = true
rotations = [
    0.68684, 0.19155, -0.19539, 0.67334,  # Hips
    0.70371, 0.69847, -0.09539, 0.08845,  # Spine
    0.98136, -0.00737, -0.00976, 0.19177,  # Chest
    0.98678, -0.04519, 0.00516, 0.15552,  # Neck
    0.99902, -0.04136, 0.0109, 0.01135,  # Head
    0.48659, -0.49096, -0.50716, -0.51476,  # Shoulder_L
    0.75173, 0.28234, -0.23657, -0.54701,  # UpperArm_L
    0.73141, -0.0852, -0.67205, -0.07828,  # LowerArm_L
    0.98923, 0.0555, -0.05544, 0.12361,  # Hand_L
    0.52587, 0.54707, -0.4877, 0.43166,  # Shoulder_R
    0.78544, 0.29423, -0.14354, -0.52527,  # UpperArm_R
    0.6754, 0.04471, -0.73449, 0.04862,  # LowerArm_R
    0.9974, 0.04584, -0.03095, -0.04626,  # Hand_R
    0.04113, -0.43357, 0.01515, -0.90005,  # UpperLeg_L
    0.9877, -0.00175, 0.15634, 0.0001,  # LowerLeg_L
    0.913, -0.02226, -0.40729, -0.00771,  # Foot_L
    0.98951, -2e-5, -0.14447, 1e-5,  # Toes_L
    0.06069, 0.91289, -0.01907, -0.40322,  # UpperLeg_R
    0.9954, -0.00238, 0.09574, 0.00013,  # LowerLeg_R
    0.9238, -0.04208, -0.38039, -0.01092,  # Foot_R
    0.98926, -0.00022, -0.14615, 0.00019,  # Toes_R
]

# Frame 136 of the clip.
[[sets]]
name = "old-rise"
# As long as in the clip.
frames = 56
# Soft: what follows may begin so many frames earlier.
drop_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [-0.0072, 1.0399]
heading_deg = 179.13
height_m = 0.9174
from_ground = true
rotations = [
    0.71319, -0.0142, 0.01445, 0.70068,  # Hips
    0.71156, 0.69994, -0.04677, 0.03961,  # Spine
    0.99833, -0.01642, -0.01012, 0.05444,  # Chest
    0.99909, -0.03366, 0.02523, -0.00725,  # Neck
    0.99322, -0.01315, 0.0334, -0.11056,  # Head
    0.47752, -0.49091, -0.51381, -0.51671,  # Shoulder_L
    0.74591, 0.31516, -0.22972, -0.53993,  # UpperArm_L
    0.77143, -0.05989, -0.63159, -0.04904,  # LowerArm_L
    0.9897, 0.05551, -0.05763, 0.11874,  # Hand_L
    0.53266, 0.5545, -0.48255, 0.41947,  # Shoulder_R
    0.77924, 0.3233, -0.13616, -0.51935,  # UpperArm_R
    0.72747, 0.04831, -0.68293, 0.04535,  # LowerArm_R
    0.99706, 0.04564, -0.03706, -0.04924,  # Hand_R
    0.06333, -0.09269, 0.03547, -0.99305,  # UpperLeg_L
    0.97344, -0.00033, 0.22893, 0.00017,  # LowerLeg_L
    0.85139, -0.00439, -0.52366, -0.02989,  # Foot_L
    0.98897, -0.0016, -0.14811, -0.00076,  # Toes_L
    -0.0759, -0.9927, 0.03531, 0.08687,  # UpperLeg_R
    0.97566, 0.00018, 0.21928, 0.00013,  # LowerLeg_R
    0.85233, -0.01315, -0.5223, -0.02388,  # Foot_R
    0.98898, -0.00035, -0.14808, 0.00042,  # Toes_R
]

# Variant curt, made from dataset-1_bow_angry_001.bvh, frames 20, 31, 45, for pack human; the poses are under the clip's licence.

[[variants]]
name = "curt"
entry = "curt-stand"

# Frame 20 of the clip.
[[sets]]
name = "curt-stand"
next = "curt-bow"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.1]
heading_deg = 180.0
height_m = 0.9248
from_ground = true
rotations = [
    0.71688, 0.02901, -0.02988, 0.69595,  # Hips
    0.69177, 0.72003, -0.04292, 0.0341,  # Spine
    0.99827, 0.03993, -0.01246, 0.04122,  # Chest
    0.99891, 0.01806, -0.0107, -0.04175,  # Neck
    0.99738, -0.01055, -0.02956, 0.06512,  # Head
    0.48106, -0.53227, -0.52049, -0.46299,  # Shoulder_L
    0.78826, -0.02335, 0.02631, -0.61434,  # UpperArm_L
    0.96704, 0.1219, -0.22179, 0.02796,  # LowerArm_L
    0.99684, 0.04359, 0.02932, 0.05955,  # Hand_L
    0.45076, 0.55274, -0.54526, 0.44043,  # Shoulder_R
    0.7874, 0.04432, 0.03788, -0.61367,  # UpperArm_R
    0.96753, 0.12996, -0.21485, 0.02885,  # LowerArm_R
    0.99167, 0.05109, -0.02909, 0.11458,  # Hand_R
    0.02323, -0.17728, 0.014, -0.98379,  # UpperLeg_L
    0.98182, -0.00021, 0.18984, 5e-5,  # LowerLeg_L
    0.8803, -0.00889, -0.47432, 0.00388,  # Foot_L
    0.98932, -0.00014, -0.14573, 0.00017,  # Toes_L
    0.10752, 0.98612, 0.07536, -0.10167,  # UpperLeg_R
    0.99159, -0.00112, 0.1294, 0.00025,  # LowerLeg_R
    0.86147, -0.07034, -0.49265, 0.10104,  # Foot_R
    0.98956, 0.00018, -0.14413, -0.00039,  # Toes_R
]

# Frame 31 of the clip.
[[sets]]
name = "curt-bow"
next = "curt-rise"
# As long as in the clip.
frames = 11

[[sets.keyframes]]
pivot = true
place_m = [0.0218, 1.2012]
heading_deg = -176.24
height_m = 0.9244
from_ground = true
rotations = [
    0.70842, 0.13509, -0.14111, 0.67821,  # Hips
    0.69237, 0.7108, -0.09927, 0.07445,  # Spine
    0.98315, 0.02592, -0.03492, 0.17756,  # Chest
    0.99711, 0.01548, -0.0265, 0.06955,  # Neck
    0.98977, -0.01572, -0.03474, 0.1375,  # Head
    0.4757, -0.53647, -0.52504, -0.45852,  # Shoulder_L
    0.80455, -0.12649, -0.0397, -0.57889,  # UpperArm_L
    0.90617, 0.1478, -0.39109, 0.06379,  # LowerArm_L
    0.99218, 0.04069, 0.04025, 0.11091,  # Hand_L
    0.45349, 0.56256, -0.5433, 0.42742,  # Shoulder_R
    0.80843, -0.01214, -0.04822, -0.58648,  # UpperArm_R
    0.92722, 0.09361, -0.36078, 0.03641,  # LowerArm_R
    0.9837, 0.05411, -0.03382, 0.16809,  # Hand_R
    0.04342, -0.33166, -0.01597, -0.94226,  # UpperLeg_L
    0.99779, -0.00016, 0.06648, -3e-5,  # LowerLeg_L
    0.93375, -0.01743, -0.35728, -0.01276,  # Foot_L
    0.99018, 0.00039, -0.13981, -0.00046,  # Toes_L
    0.12235, 0.95266, 0.12883, -0.24673,  # UpperLeg_R
    1.0, 0.00115, 6e-5, 3e-5,  # LowerLeg_R
    0.90811, -0.04132, -0.39491, 0.13297,  # Foot_R
    0.98938, -0.00013, -0.14533, 0.00017,  # Toes_R
]

# Frame 45 of the clip.
[[sets]]
name = "curt-rise"
# As long as in the clip.
frames = 14
# Soft: what follows may begin so many frames earlier.
drop_frames = 6

[[sets.keyframes]]
pivot = true
place_m = [0.0005, 1.0581]
heading_deg = 179.79
height_m = 0.9166
from_ground = true
rotations = [
    0.72134, -0.00911, 0.00949, 0.69246,  # Hips
    0.69137, 0.72038, -0.03958, 0.03848,  # Spine
    0.99825, 0.041, -0.00155, 0.04267,  # Chest
    0.99857, 0.03589, -0.03014, -0.02558,  # Neck
    0.9959, 0.00262, -0.04972, 0.07555,  # Head
    0.4841, -0.53001, -0.5179, -0.46532,  # Shoulder_L
    0.77378, -0.01885, 0.03619, -0.63214,  # UpperArm_L
    0.95873, 0.12642, -0.25249, 0.03329,  # LowerArm_L
    0.99657, 0.04375, 0.02645, 0.06515,  # Hand_L
    0.45543, 0.56014, -0.54183, 0.43041,  # Shoulder_R
    0.78704, 0.04413, 0.04752, -0.61348,  # UpperArm_R
    0.96938, 0.09547, -0.22518, 0.02217,  # LowerArm_R
    0.98971, 0.05267, -0.03579, 0.12814,  # Hand_R
    0.03103, -0.12733, 0.01136, -0.99131,  # UpperLeg_L
    0.9679, -0.00017, 0.25135, 0.0001,  # LowerLeg_L
    0.85087, -0.01209, -0.52523, 0.00271,  # Foot_L
    0.98935, -0.00012, -0.14556, 0.00015,  # Toes_L
    0.10578, 0.9908, 0.07123, -0.04522,  # UpperLeg_R
    0.98365, -0.00173, 0.18009, 0.00049,  # LowerLeg_R
    0.83459, -0.08039, -0.53682, 0.09395,  # Foot_R
    0.98956, 0.00016, -0.14413, -0.00036,  # Toes_R
]

# Variant courtly, made from dataset-1_bow_musical_001.bvh, frames 30, 84, 132, for pack human; the poses are under the clip's licence.

[[variants]]
name = "courtly"
weight = 0.5
entry = "courtly-stand"

# Frame 30 of the clip.
[[sets]]
name = "courtly-stand"
next = "courtly-bow"

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.1]
heading_deg = 180.0
height_m = 0.9169
from_ground = true
rotations = [
    0.70059, 0.03709, -0.03652, 0.71167,  # Hips
    0.68545, 0.72811, -0.00422, 0.00118,  # Spine
    0.99636, 0.0603, -0.0043, -0.06002,  # Chest
    0.99314, 0.08281, -0.02018, -0.08008,  # Neck
    0.99787, 0.06319, 0.0155, 0.00468,  # Head
    0.48736, -0.49277, -0.50717, -0.51229,  # Shoulder_L
    0.94282, -0.17893, 0.14341, -0.24187,  # UpperArm_L
    0.94661, 0.28078, -0.15186, 0.04504,  # LowerArm_L
    0.99011, 0.04042, 0.03825, 0.12878,  # Hand_L
    0.45043, 0.55966, -0.54566, 0.43145,  # Shoulder_R
    0.86636, 0.17293, -0.25795, -0.39112,  # UpperArm_R
    0.56814, 0.09158, -0.8074, 0.13015,  # LowerArm_R
    0.9899, 0.03541, 0.13196, 0.0378,  # Hand_R
    0.01027, 0.26197, -0.23414, 0.93619,  # UpperLeg_L
    0.99986, -5e-5, 0.0168, 0.0,  # LowerLeg_L
    0.99289, -0.01225, -0.11196, 0.0385,  # Foot_L
    0.9873, -0.0013, -0.15886, 0.00157,  # Toes_L
    0.21998, 0.96224, 0.07544, -0.14147,  # UpperLeg_R
    0.98627, -0.00165, 0.16511, 0.00043,  # LowerLeg_R
    0.83819, -0.12203, -0.5114, 0.14498,  # Foot_R
    0.98956, 0.00031, -0.14413, -0.00115,  # Toes_R
]

# Frame 84 of the clip.
[[sets]]
name = "courtly-bow"
next = "courtly-rise"
# As long as in the clip.
frames = 54
hold_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [0.0837, 1.2476]
heading_deg = -175.08
height_m = 0.8262
from_ground = true
rotations = [
    0.70713, 0.24009, -0.28183, 0.60241,  # Hips
    0.69543, 0.71514, -0.05976, 0.03725,  # Spine
    0.99669, 0.02783, -0.0318, 0.06949,  # Chest
    0.99462, 0.08865, -0.03739, -0.03838,  # Neck
    0.99462, 0.09215, 0.02123, 0.04238,  # Head
    0.47472, -0.52402, -0.52406, -0.47477,  # Shoulder_L
    0.84533, -0.35861, 0.27081, -0.28891,  # UpperArm_L
    0.92742, 0.22225, -0.29255, 0.07011,  # LowerArm_L
    0.95312, 0.03274, 0.04603, 0.29728,  # Hand_L
    0.43841, 0.55772, -0.55486, 0.4346,  # Shoulder_R
    0.83552, 0.18469, -0.35793, -0.37376,  # UpperArm_R
    0.42129, 0.10953, -0.87132, 0.22653,  # LowerArm_R
    0.98444, 0.06159, -0.08462, 0.14115,  # Hand_R
    -0.03717, 0.65698, -0.1778, 0.7317,  # UpperLeg_L
    0.99917, 0.00038, 0.04067, -2e-5,  # LowerLeg_L
    0.99341, -0.0173, -0.10937, 0.02953,  # Foot_L
    0.98754, -0.00117, -0.15733, 0.00141,  # Toes_L
    0.21056, 0.75662, 0.29908, -0.54198,  # UpperLeg_R
    0.95367, 0.0063, 0.30077, -0.00209,  # LowerLeg_R
    0.81505, -0.09496, -0.5171, 0.2435,  # Foot_R
    0.98956, 0.00021, -0.14409, -0.00055,  # Toes_R
]

# Frame 132 of the clip.
[[sets]]
name = "courtly-rise"
# As long as in the clip.
frames = 48
# Soft: what follows may begin so many frames earlier.
drop_frames = 10

[[sets.keyframes]]
pivot = true
place_m = [0.0417, 1.1083]
heading_deg = 179.03
height_m = 0.9119
from_ground = true
rotations = [
    0.69164, 0.0272, -0.02608, 0.72126,  # Hips
    0.68628, 0.72705, -0.01995, 0.00484,  # Spine
    0.99758, 0.05763, -0.02135, -0.03264,  # Chest
    0.99456, 0.08537, -0.01547, -0.05768,  # Neck
    0.99674, 0.07549, 0.01867, 0.02155,  # Head
    0.47987, -0.49975, -0.51475, -0.50499,  # Shoulder_L
    0.88169, -0.24714, 0.24401, -0.31939,  # UpperArm_L
    0.9248, 0.29632, -0.22724, 0.07281,  # LowerArm_L
    0.96721, 0.03917, 0.03046, 0.24907,  # Hand_L
    0.44935, 0.55965, -0.54649, 0.43155,  # Shoulder_R
    0.82421, 0.21406, -0.30436, -0.42688,  # UpperArm_R
    0.42154, 0.0953, -0.87959, 0.19887,  # LowerArm_R
    0.99031, 0.0572, -0.08617, 0.09269,  # Hand_R
    -0.0036, 0.26222, -0.24661, 0.93296,  # UpperLeg_L
    0.99945, -0.0003, 0.03324, 1e-5,  # LowerLeg_L
    0.99544, -0.00862, -0.09034, 0.0293,  # Foot_L
    0.98683, -0.00156, -0.16172, 0.00188,  # Toes_L
    0.25478, 0.9561, 0.08799, -0.11498,  # UpperLeg_R
    0.98908, -0.00068, 0.14736, 0.00022,  # LowerLeg_R
    0.83755, -0.07369, -0.51922, 0.15326,  # Foot_R
    0.98956, 0.00031, -0.14413, -0.00114,  # Toes_R
]
`],[`sign.toml`,`# A sign to bow at: a point of interest that characters come to from the front.
#
# Lengths are in metres, angles in degrees about +Y, rotations are w, x, y, z. The object's frame is right-handed with Y up; a
# character that uses it comes from its +Z side. Everything is checked on reading: an error names line, field and range.
#
# The poses are the standing key of the pack's style \`normal\`, bent by hand; like the pack's styles they are CC BY-NC 4.0
# (see NOTICE).

# Version of this format.
format = 1
# Letters, digits, '-', '_' or '.'; unique among the definitions of a server.
name = "sign"
description = "A board to stop at and bow to."
# Whether rays and boxes hit the shape. Default true; false for a mere place (see greeter.toml).
solid = true
# Whether any number of characters may use it at once. Default false: the first that wants it has it for itself.
shared = true

# The object's shape: a box along the axes, or \`[shape.convex]\` with \`points_m\`, 4 to 64 of them.
[shape.box]
center_m = [0.0, 0.9, 0.0]
half_extents_m = [0.4, 0.9, 0.05]

# Where a character's box must reach to use the object: the shape, or a \`shape\` of its own, grown by \`reach_m\` (0 to 10,
# default 0.6) on every side.
[trigger]
reach_m = 1.5

# What keyframes with \`pivot = true\` turn about. Default: the object's origin.
[anchor]
pivot_m = [0.0, 0.0, 0.0]

# Sides from which a character may come, seen from the pivot: first and last direction from the object's +Z. A character on
# another side goes to the nearest. \`distance_m\` is how far from the pivot it starts. Without it, it starts at its present
# place. A definition without approaches is used from any side.
[[approaches]]
name = "front"
directions_deg = [-60.0, 60.0]
distance_m = 1.1

# Ways to use the object, chosen by weight (default 1) and the character's seed; weight 0 is chosen by name alone. \`entry\` is
# the first set, and \`next\` of each set the one that follows. \`exit\`, where given, is the first set to leave with.
[[variants]]
name = "bow"
weight = 3.0
entry = "bow"

[[variants]]
name = "deep-bow"
weight = 1.0
entry = "deep-bow"

# A set is one phase: one to four keyframes, consecutive frames at 30 Hz, that end one stretch of motion.
[[sets]]
name = "bow"
next = "rise"
# tau: 0 (default), its last keyframe must be reached; above 0, the next phase may begin so many frames earlier.
drop_frames = 0
# Frames for which the last keyframe is held. Default 0. Or \`hold_until_ended = true\`.
hold_frames = 12
# \`frames\`, from the last frame before the set to its last keyframe, is left out: as many as the pack thinks right.
# So is \`motion\`: "plan" has the networks make it, "stance" leaves the feet where they stand and bends the rest, for poses that the
# networks do not know. Left out it is "stance" for keyframes with nothing but points and for hips below 0.7 m, else "plan".
# \`from_stand = true\` has a character that comes for this set stop first: calmer, and a second slower. Default false.

[[sets.keyframes]]
# omega: whether it turns about the pivot with the side that the character comes from. Default false: fixed to the object.
pivot = true
# Where the root is over the ground, x and z from the object.
place_m = [0.0, 1.1]
# Which way it faces: 180 is toward the object.
heading_deg = 180.0
# Height of the root joint: from the object's origin, or with \`from_ground = true\` from what the character stands on.
height_m = 0.9226
from_ground = true
# The whole pose, one rotation for each joint of the pack: the first with the heading taken out, others relative to their
# parents. Heading and height are given with it. Left out: the pose is free.
rotations = [
    0.71742, -0.02742, 0.02828, 0.69553,  # Hips
    0.67480, 0.68209, -0.19530, 0.20314,  # Spine
    0.98815, -0.00404, 0.01012, 0.15308,  # Chest
    0.99370, -0.01517, -0.00469, 0.11092,  # Neck
    0.99936, -0.01489, -0.01566, 0.02848,  # Head
    0.55217, -0.41462, -0.43500, -0.57791,  # Shoulder_L
    0.75735, 0.00101, -0.42462, -0.49610,  # UpperArm_L
    0.96063, 0.10988, -0.25505, 0.00847,  # LowerArm_L
    0.99620, 0.07110, -0.02251, 0.04496,  # Hand_L
    0.59604, 0.45783, -0.40199, 0.52301,  # Shoulder_R
    0.76038, -0.03408, -0.41385, -0.49939,  # UpperArm_R
    0.96887, 0.07152, -0.23607, 0.02120,  # LowerArm_R
    0.99656, 0.04737, -0.00888, 0.06740,  # Hand_R
    0.03795, -0.01335, 0.06629, -0.99699,  # UpperLeg_L
    0.98168, 0.00167, 0.19054, -0.00034,  # LowerLeg_L
    0.82899, 0.03752, -0.55770, -0.01836,  # Foot_L
    0.99079, -0.00153, -0.13536, 0.00382,  # Toes_L
    0.12133, 0.99256, -0.00397, 0.00955,  # UpperLeg_R
    0.98636, -0.00082, 0.16456, -0.00280,  # LowerLeg_R
    0.83282, 0.06084, -0.54994, -0.01669,  # Foot_R
    0.99042, 0.00535, -0.13778, -0.00750,  # Toes_R
]

[[sets]]
name = "deep-bow"
next = "rise"
hold_frames = 20

[[sets.keyframes]]
pivot = true
place_m = [0.0, 1.1]
heading_deg = 180.0
height_m = 0.9226
from_ground = true
rotations = [
    0.71742, -0.02742, 0.02828, 0.69553,  # Hips
    0.64335, 0.65486, -0.27660, 0.28417,  # Spine
    0.98533, -0.00388, 0.00996, 0.17031,  # Chest
    0.99370, -0.01517, -0.00469, 0.11092,  # Neck
    0.99936, -0.01489, -0.01566, 0.02848,  # Head
    0.55217, -0.41462, -0.43500, -0.57791,  # Shoulder_L
    0.73961, -0.07773, -0.47153, -0.47391,  # UpperArm_L
    0.96063, 0.10988, -0.25505, 0.00847,  # LowerArm_L
    0.99620, 0.07110, -0.02251, 0.04496,  # Hand_L
    0.59604, 0.45783, -0.40199, 0.52301,  # Shoulder_R
    0.73579, -0.10805, -0.46607, -0.47929,  # UpperArm_R
    0.96887, 0.07152, -0.23607, 0.02120,  # LowerArm_R
    0.99656, 0.04737, -0.00888, 0.06740,  # Hand_R
    0.03795, -0.01335, 0.06629, -0.99699,  # UpperLeg_L
    0.98168, 0.00167, 0.19054, -0.00034,  # LowerLeg_L
    0.82899, 0.03752, -0.55770, -0.01836,  # Foot_L
    0.99079, -0.00153, -0.13536, 0.00382,  # Toes_L
    0.12133, 0.99256, -0.00397, 0.00955,  # UpperLeg_R
    0.98636, -0.00082, 0.16456, -0.00280,  # LowerLeg_R
    0.83282, 0.06084, -0.54994, -0.01669,  # Foot_R
    0.99042, 0.00535, -0.13778, -0.00750,  # Toes_R
]

[[sets]]
name = "rise"
# Soft: it shapes the way up, and walking on may begin a third of a second before it.
drop_frames = 10

[[sets.keyframes]]
pivot = true
heading_deg = 180.0
height_m = 0.9226
from_ground = true
rotations = [
    0.71742, -0.02742, 0.02828, 0.69553,  # Hips
    0.70719, 0.70579, -0.02521, 0.03323,  # Spine
    0.99982, -0.00525, 0.01122, 0.01407,  # Chest
    0.99903, -0.01515, -0.00279, 0.04135,  # Neck
    0.99936, -0.01489, -0.01566, 0.02848,  # Head
    0.55217, -0.41462, -0.43500, -0.57791,  # Shoulder_L
    0.76775, 0.24114, -0.25700, -0.53514,  # UpperArm_L
    0.96063, 0.10988, -0.25505, 0.00847,  # LowerArm_L
    0.99620, 0.07110, -0.02251, 0.04496,  # Hand_L
    0.59604, 0.45783, -0.40199, 0.52301,  # Shoulder_R
    0.79149, 0.19354, -0.23066, -0.53186,  # UpperArm_R
    0.96887, 0.07152, -0.23607, 0.02120,  # LowerArm_R
    0.99656, 0.04737, -0.00888, 0.06740,  # Hand_R
    0.03795, -0.01335, 0.06629, -0.99699,  # UpperLeg_L
    0.98168, 0.00167, 0.19054, -0.00034,  # LowerLeg_L
    0.82899, 0.03752, -0.55770, -0.01836,  # Foot_L
    0.99079, -0.00153, -0.13536, 0.00382,  # Toes_L
    0.12133, 0.99256, -0.00397, 0.00955,  # UpperLeg_R
    0.98636, -0.00082, 0.16456, -0.00280,  # LowerLeg_R
    0.83282, 0.06084, -0.54994, -0.01669,  # Foot_R
    0.99042, 0.00535, -0.13778, -0.00750,  # Toes_R
]
`],[`courtyard.toml`,`# A courtyard: a step, a ramp, a mound, a table, and the objects of examples/objects.
#
# Lengths are in metres, angles in degrees about +Y, rotations are w, x, y, z; right-handed with Y up. Everything is checked on
# reading: an error names line, field and range.

# Version of this format.
format = 1
# Letters, digits, '-', '_' or '.'; unique among the scenes of a server.
name = "courtyard"
# Height of the ground plane. Default 0.
ground_m = 0.0

# What is there to stand on, to put things on, and in the way to objects; it does not stop locomotion. At most 1024 of them. \`id\` is
# unique among them, \`position_m\` (default: the scene's origin) and \`heading_deg\` or \`rotation\` (default: not turned) say where the
# frame of the shape is. There is no scale.
[[colliders]]
id = "step"
position_m = [0.0, 0.1, 4.0]
heading_deg = 15.0

# A box along the axes of that frame: \`half_extents_m\`, and \`center_m\` if it is not about the origin.
[colliders.shape.box]
half_extents_m = [1.5, 0.1, 0.5]

[[colliders]]
id = "table"
position_m = [2.5, 0.0, 0.0]

[colliders.shape.box]
center_m = [0.0, 0.425, 0.0]
half_extents_m = [0.4, 0.425, 0.7]

[[colliders]]
id = "ramp"
position_m = [-4.0, 0.0, 0.0]

# The hull of 4 to 64 points.
[colliders.shape.convex]
points_m = [
    [-1.0, 0.0, -1.5], [1.0, 0.0, -1.5], [-1.0, 0.0, 1.5], [1.0, 0.0, 1.5],
    [-1.0, 0.6, 1.5], [1.0, 0.6, 1.5],
]

[[colliders]]
id = "mound"
position_m = [0.0, 0.0, -6.0]

# Heights over a grid, centred on the origin: \`rows\` along z, the first at the least z, each with \`columns\` samples along x.
# \`size_m\` is its size along x and z. It may be turned about +Y alone.
[colliders.shape.heightfield]
rows = 4
columns = 5
size_m = [4.0, 3.0]
heights_m = [
    0.0, 0.00, 0.00, 0.00, 0.0,
    0.0, 0.15, 0.25, 0.15, 0.0,
    0.0, 0.15, 0.25, 0.15, 0.0,
    0.0, 0.00, 0.00, 0.00, 0.0,
]

# What may be used, at most 4096 of them. \`id\` is unique among them, \`definition\` is the name of a definition that the server
# has.
[[objects]]
id = "cup-1"
definition = "cup"
position_m = [2.3, 0.85, 0.3]

[[objects]]
id = "cup-2"
definition = "cup"
position_m = [2.3, 0.85, -0.3]
heading_deg = 40.0

[[objects]]
id = "sign"
definition = "sign"
position_m = [-1.5, 0.0, -3.0]
heading_deg = 20.0

[[objects]]
id = "gate"
definition = "greeter"
position_m = [4.0, 0.0, 5.0]
rotation = [0.7071068, 0.0, -0.7071068, 0.0]

[[objects]]
id = "stool"
definition = "seat"
position_m = [-3.0, 0.0, 4.5]
heading_deg = 150.0

[[objects]]
id = "shrine"
definition = "shrine"
position_m = [3.5, 0.0, -3.5]
heading_deg = -45.0
`]];export{e as COURTYARD};