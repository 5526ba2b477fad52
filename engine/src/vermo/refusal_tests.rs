use troupe_motion::model::{AgentTask, Audio, KeyTensors, PathTask, PromptTask, Sound};

use super::generator_tests::{id, keys, prompt, run, vermo};
use super::toy::{pack, toy};
use super::*;
use crate::EngineError;
use crate::generator::Generator;

#[test]
fn tasks_out_of_range_fail_alone_with_a_reason() {
    let good = prompt("walk", Some(16));
    let context = keys(&[1, 1, 1, 1], 0.0);
    let with = |change: fn(&mut PromptTask)| {
        let mut task = good.clone();
        change(&mut task);
        task
    };
    let cases = [
        (
            with(|t| t.text = "a".repeat(40)),
            "text is 41 pieces long; allowed: at most 32 pieces",
        ),
        (with(|t| t.frames = Some(0)), "frames is 0; allowed: 1 to 4096"),
        (
            with(|t| t.sampling.temperature = Some(3.0)),
            "temperature is 3; allowed: 0 to 2",
        ),
        (
            with(|t| t.sampling.top_p = Some(0.0)),
            "top_p is 0; allowed: more than 0 to 1",
        ),
        (
            with(|t| t.sampling.repetition = Some(0.5)),
            "repetition is 0.5; allowed: 1 to 10",
        ),
        (
            with(|t| t.flow_steps = 500),
            "flow_steps is 500; allowed: 0 to 256",
        ),
        (
            with(|t| t.others = vec![AgentTask::default(); 3]),
            "others is 3; allowed: 0 to 2",
        ),
        (
            with(|t| t.others = vec![AgentTask::default()]),
            "text is empty; allowed: text for each character, or for none",
        ),
        (
            with(|t| t.context = vec![KeyTensors::default(); 3]),
            "context is 3; allowed: 16 or more",
        ),
        (
            with(|t| t.context = vec![KeyTensors::default(); 16]),
            "context is without a root or a pose",
        ),
        (
            with(|t| t.targets = vec![KeyTensors::default(); 4]),
            "targets is 4; allowed: none without a context",
        ),
        (
            PromptTask {
                context: context.clone(),
                targets: context.clone(),
                ..prompt("", Some(30))
            },
            "frames is 30; allowed: 8 to 64 between context and targets, a multiple of 4",
        ),
        (
            PromptTask {
                audio: Some(Audio {
                    sound: Sound::Music,
                    codes: vec![5],
                }),
                ..prompt("", None)
            },
            "audio is 5; allowed: codes below 5",
        ),
        (
            PromptTask {
                audio: Some(Audio {
                    sound: Sound::Speech,
                    codes: vec![1],
                }),
                ..prompt("", None)
            },
            "kind is speech_to_gesture; allowed: text_to_motion, motion_to_text",
        ),
        (
            PromptTask {
                audio: Some(Audio {
                    sound: Sound::Music,
                    codes: vec![1; 75],
                }),
                ..prompt("", None)
            },
            "message is too long, with room for 0 tokens; allowed: at most 80 tokens of message and reply",
        ),
    ];
    let mut vermo = vermo(4);
    for (request, (task, _)) in cases.iter().enumerate() {
        vermo.admit(id(request as u64), task.clone().into());
    }
    let path = PathTask {
        sways: false,
        body: crate::pack::Pack::load(
            &std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/unimogen"),
        )
        .unwrap()
        .bodies[0]
            .clone(),
        context: Vec::new(),
        targets: Vec::new(),
        path: Box::default(),
        style: Vec::new(),
        steps: 1,
        guidance: 1.0,
        seed: 0,
    };
    vermo.admit(id(100), path.into());
    vermo.admit(id(101), good.clone().into());
    let given = run(&mut vermo, |_, _| false);
    for (request, (_, said)) in cases.iter().enumerate() {
        let found = given[&(request as u64)].failed.as_deref().unwrap_or("nothing");
        assert!(found.contains(said), "{request}: {found}");
    }
    assert_eq!(given[&100].failed, Some(EngineError::WrongTask.to_string()));
    assert_eq!(given[&101].motion().frames(), 16);
}

#[test]
fn a_job_whose_logits_are_not_finite_fails_alone() {
    let pack = pack();
    let mut toy = toy(&pack);
    // The first token of a motion.
    toy.broken = Some(vocabulary::REPLY);
    let mut vermo = VerMo::new(&pack, Box::new(toy), 2).unwrap();
    vermo.admit(id(1), prompt("walk", Some(16)).into());
    let given = run(&mut vermo, |_, _| false);
    assert_eq!(
        given[&1].failed.as_deref(),
        Some("language.onnx: logits that are not finite")
    );
    assert!(vermo.is_idle());
}
