# make run   gets ONNX Runtime, builds, starts the server with the packs in models/ and the example scenes
# make docs  builds the site of docs/, which the server shows at /docs
# make test  lints and tests everything, Rust and Python
.PHONY: run docs test lint budgets rust-test python-test python-client web-test mmcp-test mmcp-figure sonic-test sonic-figure ros2-test ros2-figure cluster-test cluster-failures cluster-figure swap-figure kubernetes-test c-client godot-client fuzz fuzz-all fuzz-planted runtime python-env python-lock real-clips pack body web pictures viewer-figures picture samples styles eval live-eval object-eval film \
	film-objects film-skills skills film-crowd film-live film-words film-impossible image crowd load bench bench-serving bench-micro bench-instructions

DATA_ARCHIVE := ../shared/data/bandai-namco-train.tar.xz
REAL_CLIPS := target/data/bandai-namco
# The pack that `make styles` and `make eval` are about.
PACK := human

# The server gets copies of the example scenes and objects, unless the environment names other folders. The site of the documentation
# is built while the server starts, which shows it at /docs as soon as it is there.
EXAMPLES := target/run
run: export TROUPE_SCENES ?= $(EXAMPLES)/scenes
run: export TROUPE_OBJECTS ?= $(EXAMPLES)/objects
run: runtime
	cargo build --release --package troupe-server
	@scripts/example-folders.sh $(EXAMPLES)
	@(scripts/docs.sh build >target/docs.log 2>&1 || \
		echo "*** /docs IS WITHOUT THE DOCUMENTATION: see target/docs.log" >&2) &
	cargo run --release --package troupe-server

# The site of docs/: ARGS=check for the references too, ARGS=references to write those
docs:
	scripts/docs.sh $(or $(ARGS),build)

# The site is built before the tests, which look at it.
test: docs-check lint rust-test python-test python-client web-test mmcp-test sonic-test ros2-test cluster-test kubernetes-test c-client

.PHONY: docs-check
docs-check:
	scripts/docs.sh check

lint: python-env
	cargo fmt --all --check
	scripts/check-layers.sh
	scripts/check-prometheus.sh
	cargo clippy --workspace --all-targets --locked -- -D warnings
	scripts/tool.sh cargo-deny --log-level error check bans licenses sources
	.venv/bin/typos
	python3 scripts/check-prose.py
	.venv/bin/ruff format --check
	.venv/bin/ruff check
	.venv/bin/mypy
	cd training && ../.venv/bin/lint-imports --no-logo

# Real clips are used where they are at hand; the tests make their own motion besides. Tests that share a loaded server run as one
# process, the others as one each.
CARGO_TEST := --workspace --locked
rust-test: runtime real-clips python-env
	if [ -d $(REAL_CLIPS) ]; then export TROUPE_DATA="$(CURDIR)/$(REAL_CLIPS)"; fi; \
	scripts/tool.sh cargo-nextest nextest run $(CARGO_TEST) -E 'not (binary(e2e) or binary(packs))' && \
	cargo test $(CARGO_TEST) --test e2e --test packs && cargo test $(CARGO_TEST) --doc

python-test: python-env
	cd training && OMP_NUM_THREADS=1 ../.venv/bin/python -m pytest --quiet --numprocesses auto
	.venv/bin/python -m pytest --quiet bench/tests
	.venv/bin/python -m pytest --quiet -c bindings/python/pyproject.toml --rootdir bindings/python bindings/python/tests

# The viewer: its sources are checked, web/dist is what they build, and a browser uses it. Without npm it is left out, aloud.
web-test: runtime
	@if command -v npm >/dev/null; then scripts/web.sh check && scripts/web.sh build && scripts/test-server.sh && scripts/web.sh e2e; \
	else echo "*** THE VIEWER WAS NOT TESTED: there is no npm (Node 20.19 or newer)" >&2; fi

# The Python client as users get it: its wheel is built, installed in an environment of its own, checked and tested.
python-client:
	scripts/python-client.sh $(ARGS)

# The Motion Model Context Protocol, with its own Python packages as the other side, through a running server with the packs in models/
mmcp-test: runtime
	tests/mmcp/setup.sh
	TROUPE_BUILD=debug scripts/with-server.sh target/mmcp/venv/bin/python -m pytest --quiet tests/mmcp

# A request of eight samples of four seconds in one batch, beside one request a sample (ARGS="--samples 4" for others; see --help)
mmcp-figure: runtime
	tests/mmcp/setup.sh
	scripts/with-server.sh target/mmcp/venv/bin/python tests/mmcp/figure.py $(ARGS)

# The bridge to SONIC's controller, with robots by its written rules as the other side, over ZeroMQ's own library
sonic-test: runtime
	tests/sonic/setup.sh
	cargo test --workspace --locked --no-run --test e2e --test packs
	target/sonic/venv/bin/python -m pytest --quiet tests/sonic

# Twenty robots on their routes for ten minutes: broken rules, times of windows, cores (ARGS="--robots 4 --seconds 60" for a short look)
sonic-figure: runtime
	tests/sonic/setup.sh
	cargo build --release --package troupe-server --package troupe-cli
	TROUPE_BUILD=release TROUPE_CLI=troupe target/sonic/venv/bin/python tests/sonic/figure.py $(ARGS)

# The C interface and what stands on it: C with sanitizers, a CMake package, C# under Mono. Without cmake or mono parts are left out, aloud.
c-client: runtime
	scripts/c-client.sh

# The Godot extension: checked, tested, and run in Godot 4 if there is one. It takes minutes, so `make test` leaves it out.
godot-client: runtime
	scripts/godot-client.sh

# The ROS 2 node, with another DDS as the other side
ros2-test: runtime
	tests/ros2/setup.sh
	cargo test --workspace --locked --no-run --test e2e --test packs
	target/ros2/venv/bin/python -m pytest --quiet tests/ros2

# Two robots that walk for a minute: rate, time of a pose under way, cores (ARGS="--seconds 10" for a short look)
ros2-figure: runtime
	tests/ros2/setup.sh
	cargo build --release --package troupe-server --package troupe-ros2
	TROUPE_BUILD=release TROUPE_ROS2=troupe-ros2 target/ros2/venv/bin/python tests/ros2/figure.py $(ARGS)

# HAProxy and Envoy: which server gets what, and who moves if one is not there. Without haproxy its part is left out, aloud.
cluster-test:
	tests/cluster/setup.sh
	target/cluster/venv/bin/python -m pytest --quiet -rs tests/cluster/test_processes.py tests/cluster/test_routing.py tests/cluster/test_store_tls.py

# Three servers with one store behind HAProxy: what characters notice of failures. It needs haproxy and redis-server.
cluster-failures: runtime
	tests/cluster/setup.sh
	scripts/test-server.sh
	target/cluster/venv/bin/python -m pytest --quiet -rs tests/cluster/test_failures.py

# 300 characters for three minutes while servers are killed and Redis fails, what one, two and three servers can do, and what Redis
# costs beside redb (ARGS="--only failures --characters 30 --seconds 40" for a short look)
cluster-figure: runtime
	tests/cluster/setup.sh
	cargo build --release --package troupe-server --package troupe-loadtest
	TROUPE_SERVER=target/release/troupe-server target/cluster/venv/bin/python tests/cluster/figure.py $(ARGS)

# A pack that is swapped under live characters, and under single requests (ARGS="--only live --characters 100")
swap-figure: runtime
	tests/cluster/setup.sh
	cargo build --release --package troupe-server --package troupe-loadtest
	TROUPE_SERVER=target/release/troupe-server target/cluster/venv/bin/python tests/cluster/swap.py $(ARGS)

# The manifests and the page that plans: rendered by kubectl and checked against Kubernetes' own schemas. Without kubectl they are left
# out, aloud.
kubernetes-test:
	tests/kubernetes/setup.sh
	target/kubernetes/venv/bin/python -m pytest --quiet -rs tests/kubernetes

# Every figure of budgets.toml beside its limit. Those of the image are measured by `make image`.
budgets:
	python3 scripts/budgets.py

# libFuzzer on one target: make fuzz TARGET=object SECONDS=60 (see fuzz/README.md)
fuzz:
	scripts/fuzz.sh $(TARGET) $(SECONDS)

# libFuzzer on every target, a million executions each or RUNS, and a table of what they saw.
fuzz-all:
	scripts/fuzz.sh all $(RUNS)

# The bug that is planted in each target must be found.
fuzz-planted:
	scripts/fuzz.sh planted $(RUNS)

# The ONNX Runtime library, pinned by hash, at .runtime/libonnxruntime.so: with OpenVINO where the CPU computes in bf16, else
# the plain one. TROUPE_RUNTIME=cpu, openvino or gpu decides otherwise.
runtime:
	@scripts/get-runtime.sh

# The server's image, built, run and checked without a container engine, as root: RUNTIME=cpu, openvino or gpu (docs/docker.md)
image:
	@scripts/image.sh

# A virtual environment with PyTorch, the training package and the reader of motion files, at .venv. Rust builds the reader.
python-env:
	@scripts/python-env.sh

# The lock of that environment, after a change of training/pyproject.toml or scripts/tools.txt (ARGS=--upgrade for newer packages).
python-lock:
	scripts/lock-python.sh $(ARGS)

# Unpacks the motion data set where its archive lies beside the checkout.
real-clips:
	@if [ -f $(DATA_ARCHIVE) ] && [ ! -d $(REAL_CLIPS) ]; then \
		mkdir -p $(REAL_CLIPS).partial && tar xJf $(DATA_ARCHIVE) -C $(REAL_CLIPS).partial && \
		mv $(REAL_CLIPS).partial/bandai-namco $(REAL_CLIPS) && rm -rf $(REAL_CLIPS).partial; \
	fi

# Trains a pack from a folder of BVH files: make pack DATA=folder OUT=models/mine (ARGS="--minutes 5" for a short try), or of a
# robot's CSV files: make pack DATA=folder OUT=models/my-robot ARGS="--urdf robot.urdf"
pack: python-env
	.venv/bin/troupe-train pack "$(DATA)" --out "$(or $(OUT),models/mine)" --name "$(notdir $(or $(OUT),models/mine))" $(ARGS)

# A pack's styles, from the motion data that models/PACK/styles.toml names: make styles DATA=folder [PACK=g1]
styles: runtime
	@[ -d "$(DATA)" ] || { echo "usage: make styles DATA=folder of BVH files, or of a robot's CSV files [PACK=g1]" >&2; exit 2; }
	cargo build --release --package troupe-cli
	scripts/with-server.sh target/release/troupe style build --pack $(PACK) --list models/$(PACK)/styles.toml \
		--data "$(DATA)" --out models/$(PACK)/styles $(ARGS)

# The skills of g1 from clips, rebuilt by its networks: make skills DATA=folder of the robot's CSV files
skills: runtime
	@[ -d "$(DATA)" ] || { echo "usage: make skills DATA=folder of a robot's CSV files" >&2; exit 2; }
	cargo build --release --package troupe-cli
	scripts/with-server.sh scripts/build-skills.sh target/release/troupe "$(DATA)" models/g1/skills

# Every figure of how well a pack fills gaps, and what characters that wander for a minute make of it: make eval DATA=folder
# (PACK=g1 for another pack, SPLIT=list of the clips to use, ARGS="--max-windows 50 --seeds 0" for a short look). With
# models/PACK/evaluator.onnx FID too.
eval: runtime
	@[ -d "$(DATA)" ] || { echo "usage: make eval DATA=folder of clips [SPLIT=file] [PACK=g1]" >&2; exit 2; }
	cargo build --release --package troupe-eval --bin troupe-eval
	scripts/with-server.sh sh -c 'target/release/troupe-eval gaps --pack $(PACK) --data "$(DATA)" $(if $(SPLIT),--split "$(SPLIT)") \
		--json target/eval.json $(ARGS) && target/release/troupe-eval wander --pack $(PACK) --against target/eval.json'

# How well live characters obey and move, beside the clips where they are at hand (ARGS="--styles normal" for a short look)
live-eval: runtime real-clips
	cargo build --release --package troupe-eval --bin troupe-eval
	scripts/with-server.sh target/release/troupe-eval live $(ARGS) \
		$$([ ! -d $(REAL_CLIPS) ] || echo --data $(REAL_CLIPS) --list models/human/styles.toml)

# The skinned body of the human pack, for the viewer: web/src/bodies/human.glb, from the pack's skeleton
body:
	@[ -x .venv-body/bin/python ] || python3 -m venv .venv-body
	@.venv-body/bin/python -m pip install --quiet --disable-pip-version-check -r web/scripts/body-requirements.txt
	.venv-body/bin/python web/scripts/make_body.py $(ARGS)

# The viewer's built files, web/dist, from its sources (they are committed, because the server embeds them).
web:
	WEB_DIST=any scripts/web.sh build

# The pictures of the viewer in docs/pictures, for README.md and docs/: a browser, a server, the packs in models/
pictures: runtime web
	cargo build --release --package troupe-server
	scripts/web.sh pictures $(ARGS)

# What a crowd of 200 costs a browser, and what 1, 10 and 100 viewers cost the server (docs/viewer.md)
viewer-figures: runtime
	cargo build --release --package troupe-server
	scripts/web.sh measure
	cargo run --release --package troupe-eval -- viewers $(ARGS)

# The picture of docs/requests.md, of a clip of the test split, through a running server.
picture: real-clips
	cargo run --release --package troupe-cli -- film --from 40 --to 85 \
		--clip $(REAL_CLIPS)/dataset-2_walk-turn-left_active_007.bvh --out docs/images/inbetween.png

# How characters use the objects of examples/objects: the tables of docs/objects.md, about ten minutes (ARGS="--only cup" for one)
object-eval: runtime
	cargo run --release --package troupe-eval -- objects $(ARGS)

# Filmstrips of the scripted paths in examples/paths, through a running server.
film: runtime
	cargo build --release --package troupe-cli
	for path in square figure-of-eight reversal style-changes; do \
		scripts/with-server.sh target/release/troupe film --path examples/paths/$$path.toml \
			--out docs/images/$$path.png || exit 1; \
	done

# Filmstrips of characters that use objects, for docs/objects.md, through a running server.
film-objects: runtime
	cargo build --release --package troupe-cli
	scripts/with-server.sh scripts/film-objects.sh target/release/troupe docs/images

# The pictures of docs/skills.md: the robot crouches and crawls, jumps, lies down and gets up, through a running server.
film-skills: runtime
	cargo build --release --package troupe-cli
	scripts/with-server.sh scripts/film-skills.sh target/release/troupe docs/images

# The moving picture of README.md: ten characters on the square of examples/casts/plaza.toml, through a running server.
film-crowd: runtime
	cargo build --release --package troupe-cli
	scripts/with-server.sh scripts/film-crowd.sh target/release/troupe docs/images/crowd.png

# The pictures of docs/live.md: characters that turn about, step aside and differ by seed, through a running server.
film-live: runtime
	cargo build --release --package troupe-cli
	scripts/with-server.sh scripts/film-live.sh target/release/troupe docs/images

# The moving picture of docs/words.md: six characters that act out the sentences of examples/casts/words.toml, through a running server.
film-words: runtime
	cargo build --release --package troupe-cli
	scripts/with-server.sh scripts/film-words.sh target/release/troupe docs/images/words.png

# The picture of docs/requests.md: three targets that cannot be met, through a running server.
film-impossible: runtime python-env
	scripts/with-server.sh .venv/bin/python scripts/draw-impossible.py docs/images/impossible.png

# A hundred characters that wander for a minute on the server's clock (ARGS="--characters 200 --duration 20s" for others; see --help)
crowd: runtime
	cargo build --release --package troupe-loadtest
	scripts/with-server.sh target/release/troupe-loadtest run --workload drive $(or $(ARGS),--characters 100 --duration 60s)

# A load test against a running server or one of its own (ARGS="search --workload drive --p99-ms 33"; see docs/loadtest.md)
load: runtime
	cargo build --release --package troupe-loadtest
	scripts/with-server.sh target/release/troupe-loadtest $(or $(ARGS),run --clients 32)

# examples/walk.bvh, which the default pack makes along examples/paths/walk.toml, and examples/request.json, a gap in it.
samples: runtime
	cargo build --release --package troupe-cli
	scripts/with-server.sh target/release/troupe drive --path examples/paths/walk.toml --out examples/walk.bvh
	cargo run --package troupe-eval -- sample-request models/human examples/walk.bvh >examples/request.json

# The benchmarks, into bench/figures and docs/benchmarks.md: PARTS for some of them, ARGS=--quick for a short look, ARGS=--help for the list
bench: bench-env
	$(BENCH) $(ARGS) $(PARTS)

# The raw ONNX Runtime loop, the server, LitServe and FastAPI side by side.
bench-serving: bench-env
	$(BENCH) $(ARGS) build verify tune serving report

# Criterion benches of the pure parts.
bench-micro: bench-env
	$(BENCH) $(ARGS) micro report

# Instructions of the hot loop under valgrind, beside bench/instructions.json (ARGS=--save makes them the new table)
bench-instructions: bench-env
	PYTHONPATH=bench target/bench/venv/bin/python -m troupe_bench.instructions $(ARGS)

.PHONY: bench-env
BENCH := PYTHONPATH=bench target/bench/venv/bin/python -m troupe_bench
bench-env:
	@bench/setup.sh
