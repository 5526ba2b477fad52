#!/usr/bin/env bash
# Makes the skills of the pack g1 from clips, with the server that TROUPE_SERVER names: build-skills.sh TROUPE DATA FOLDER
# DATA is the folder of the LAFAN1 Retargeting Dataset's CSV files for the G1. The pack's networks rebuild every pose, so that no
# frame of a clip is in what is written. Frames were chosen by eye: moments at which a movement rests or turns. Clips of the test split
# (subject 5) are not used.
set -euo pipefail
[ $# -eq 3 ] || { echo "usage: build-skills.sh TROUPE DATA FOLDER" >&2; exit 2; }
troupe=$1 data=$2 folder=$3
new() { "$troupe" object new --skill --rebuild --stand --pack g1 "$@"; }
mkdir -p "$folder"

new --from "$data/walk3_subject1.csv" --start 6500 --frames 6518,6545,6602,6618,6640 --sets squat,sit,lean,push,stand \
    --name sit-on-ground --variant hands-back --description "Sits down on the ground, hands behind, and rises when it is ended." \
    --hold 6545 --soft 6518=2 --soft 6602=2 --soft 6618=2 --force --out "$folder/sit-on-ground.toml"

new --from "$data/walk3_subject4.csv" --start 5826 --frames 5847,5868,5900,6501,6533,6565,6600,6645 \
    --sets kneel,sit,lie,turn,crouch,half-up,rise,stand --name lie-down --variant back \
    --description "Lies down on its back or its front, and gets up when it is ended." \
    --hold 5900 --soft 5847=2 --soft 5868=2 --soft 6501=2 --soft 6533=2 --soft 6565=2 --soft 6600=2 --force --out "$folder/lie-down.toml"
new --from "$data/fallAndGetUp2_subject2.csv" --start 592 --frames 614,641,680,720,752,891,912,955,985,1029 \
    --sets front-squat,front-kneel,front-hands,front-plank,front-lie,front-push,front-lift,front-knee,front-rise,front-stand \
    --variant front --hold 752 --soft 614=2 --soft 641=2 --soft 680=2 --soft 720=2 --soft 891=2 --soft 912=2 --soft 955=2 \
    --soft 985=2 --into "$folder/lie-down.toml"

new --from "$data/fight1_subject3.csv" --start 4150 --frames 4170,4180,4192,4212 --sets bend,fly,land,stand --name jump --variant up \
    --description "Jumps: up on the spot, or ahead from a squat." --soft 4170=1 --soft 4180=1 --soft 4192=1 --force --out "$folder/jump.toml"
new --from "$data/fightAndSports1_subject1.csv" --start 5205 --frames 5230,5252,5268,5292,5320 \
    --sets ahead-squat,ahead-fly,ahead-land,ahead-settle,ahead-stand --variant ahead --soft 5230=1 --soft 5252=1 --soft 5268=1 \
    --soft 5292=2 --into "$folder/jump.toml"
