//! Replies to captions that name a style.

use std::sync::Arc;

use troupe_motion::model::{AgentTask, PromptTask};

use super::generator_tests::{Given, id, keys, prompt, run};
use super::plan::Planner;
use super::toy::{lexicon, pack, toy};
use super::*;
use crate::generator::Generator as _;
use crate::pack::{MessageTask, Pack};

/// A toy pack whose replies are guided if the caption is sad.
fn guided() -> Pack {
    let mut pack = pack();
    let table = pack.manifest.vermo.as_mut().unwrap();
    (table.content_guidance, table.style_guidance) = (2.0, 4.5);
    pack.lexicon = Some(Arc::new(lexicon().with_styles("sad\nlike a sad one\n")));
    pack
}

fn guides(task: &PromptTask) -> Vec<Guide> {
    let planner = Planner::new(&guided()).unwrap();
    planner.guides(&planner.prompt(task).unwrap(), Some(8))
}

#[test]
fn the_guides_are_the_caption_without_its_style_and_no_caption() {
    let vocabulary = toy(&pack()).vocabulary;
    let message = |task, captions| Message {
        task,
        captions,
        condition: Condition::None,
        length: Some(8),
    };
    let plain = message(
        MessageTask::TextToMotion,
        vec![lexicon().pieces("a walk").unwrap()],
    );
    let nothing = message(MessageTask::Unconditional, Vec::new());
    let wanted = [(plain, -2.5), (nothing, -1.0)].map(|(message, weight)| Guide {
        tokens: message.tokens(&vocabulary),
        weight,
    });
    assert_eq!(guides(&prompt("A SAD walk!", Some(32))), wanted);
}

#[test]
fn only_one_character_with_a_style_and_a_content_alone_is_guided() {
    let styled = prompt("a sad walk", Some(32));
    let with_context = PromptTask {
        context: keys(&[3; 4], 0.0),
        ..styled.clone()
    };
    let with_others = PromptTask {
        others: vec![AgentTask {
            text: "a walk".to_owned(),
            ..AgentTask::default()
        }],
        ..styled.clone()
    };
    for task in [
        &with_context,
        &with_others,
        &prompt("a walk", Some(32)),
        &prompt("sad", Some(32)),
    ] {
        assert!(guides(task).is_empty(), "{:?}", task.text);
    }
    assert_eq!(guides(&styled).len(), 2);
    let planner = Planner::new(&pack()).unwrap();
    let speech = planner.prompt(&styled).unwrap();
    assert!(
        planner.guides(&speech, Some(8)).is_empty(),
        "a pack without guidance"
    );
}

fn made(tasks: &[PromptTask]) -> Vec<Given> {
    let pack = guided();
    let mut vermo = VerMo::new(&pack, Box::new(toy(&pack)), tasks.len()).unwrap();
    for (request, task) in tasks.iter().enumerate() {
        vermo.admit(id(request as u64), task.clone().into());
    }
    run(&mut vermo, |_, _| false).into_values().collect()
}

#[test]
fn a_guided_motion_is_the_same_alone_and_among_others() {
    let tasks = [
        prompt("a sad walk", Some(40)),
        prompt("a walk", Some(24)),
        prompt("wave like a sad one", Some(32)),
        // It takes a second reply, which is not guided.
        prompt("a sad wave", Some(100)),
    ];
    let together = made(&tasks);
    for (task, given) in tasks.iter().zip(&together) {
        assert_eq!(given.motion().frames(), task.frames.unwrap());
        assert_eq!(&made(std::slice::from_ref(task))[0], given);
    }
    let mut unguided = VerMo::new(&pack(), Box::new(toy(&pack())), 1).unwrap();
    unguided.admit(id(0), tasks[0].clone().into());
    let plain = run(&mut unguided, |_, _| false).remove(&0).unwrap();
    assert_ne!(plain.motion(), together[0].motion());
}
