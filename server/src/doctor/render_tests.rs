use std::time::Duration;

use crate::config::{MemoryUse, WorstCase};
use crate::doctor::{Engine, Library, Speed, Trial};
use troupe_engine::accuracy::Accuracy;
use troupe_engine::gpu::Gpu;
use troupe_engine::machine::Machine;
use troupe_engine::onnx::Batching;
use troupe_engine::{Check, Decision, EngineKind, Workers};

use super::*;

fn report() -> Report {
    let workers = Workers { count: 2, threads: 1 };
    let accuracy = Accuracy {
        characters: 48,
        joint_mean_m: 0.000_33,
        tokens_differ: 0.2,
        ..Accuracy::default()
    };
    let check = Check {
        engine: EngineKind::OpenvinoBf16,
        accuracy,
        passed: accuracy.passes(),
        took: Duration::from_millis(1234),
    };
    let engine = |engine: EngineKind, missing: Option<&str>| Engine {
        engine,
        offered: missing.is_none(),
        missing: missing.map(str::to_owned),
        tested: engine.is_tested(),
    };
    Report {
        version: "1.2.3",
        machine: Machine {
            cpu: "A CPU".into(),
            features: vec!["avx2", "avx512_bf16"],
            cores: 2,
            host_cores: 64,
            memory_bytes: 4 << 30,
            host_memory_bytes: 256 << 30,
            gpus: vec![Gpu {
                index: 0,
                name: "NVIDIA H200".into(),
                driver: "580.159.04".into(),
                memory_bytes: 143_771 << 20,
            }],
        },
        workers,
        library: Some(Library {
            path: "/lib/libonnxruntime.so.1.24.1".into(),
            version: Some("1.24.1".into()),
            build: "a build",
        }),
        engines: vec![
            engine(EngineKind::Cpu, None),
            engine(EngineKind::OpenvinoBf16, Some("the CPU has neither")),
            engine(EngineKind::Cuda, None),
            engine(EngineKind::Tensorrt, Some("not offered")),
        ],
        packs: vec![
            PackReport {
                name: "human".into(),
                version: "0.1".into(),
                parameters: 11_700_000,
                decision: Some(Decision {
                    engine: EngineKind::Cpu,
                    workers,
                    batching: Batching::UNKNOWN,
                    why: "openvino-bf16 fails".into(),
                    check: Some(check),
                }),
                trial: Some(Trial {
                    load_s: 0.25,
                    warm_up_s: 1.5,
                    frames: 36,
                    speeds: vec![Speed {
                        workers,
                        batch: 8,
                        batch_ms: 28.1,
                        plans_per_s: 570.2,
                    }],
                }),
            },
            PackReport {
                name: "broken".into(),
                version: "0.2".into(),
                parameters: 0,
                decision: None,
                trial: None,
            },
        ],
        memory: WorstCase {
            parts: vec![MemoryUse {
                what: "sessions",
                bytes: 1 << 30,
                bounded_by: "max_sessions",
            }],
            total_bytes: 1 << 30,
        },
        problems: vec!["pack broken: it is".into()],
        warnings: vec!["a warning".into()],
    }
}

#[test]
fn a_report_as_text() {
    insta::assert_snapshot!(report().to_string());
}

#[test]
fn a_report_as_json() {
    let json = serde_json::to_value(report()).unwrap();
    assert_eq!(json["packs"][0]["decision"]["engine"], "cpu");
    assert_eq!(
        json["packs"][0]["decision"]["check"]["accuracy"]["tokens_differ"],
        0.2
    );
    assert_eq!(json["packs"][0]["trial"]["speeds"][0]["plans_per_s"], 570.2);
    assert_eq!(json["machine"]["features"][1], "avx512_bf16");
}
