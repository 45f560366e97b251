# The commands of daily work; `just` lists them.
default:
    @just --list

# Everything the gate runs.
ci:
    bash .ci/run

# The README's test command.
test:
    cargo test --workspace

# Formatting and lints, as the gate wants them.
lint:
    cargo fmt --all
    cargo clippy --workspace --all-targets -- -D warnings

# The paper's table, beside its published figures.
table *ARGS:
    cargo run --release -- table {{ARGS}}

# Every published number that can be rerun, against its accepted interval.
check-table:
    cargo run --release -- table --check benchmarks/tables/table1.csv

# Growth curves of every stage.
bench *ARGS:
    cargo bench -p accurate-speed {{ARGS}}

# The same answers from other people's tools (Python, pinned).
peers:
    bash benchmarks/peers/run

# Every curve file, opened by the tools that people use (Python, pinned).
formats:
    bash benchmarks/peers/formats

# The page behind --report, bundled anew (Node.js) and committed.
report:
    npm --prefix web/report ci && npm --prefix web/report run build

# Reports in a headless Chromium, if there is one.
check-report:
    bash web/report/check

# Every figure that `accurate` mode promises on generated data, beside `paper` mode (docs/results.md).
acceptance *ARGS:
    cargo run --release -p accurate3d --example acceptance -- {{ARGS}}

# What each step of `accurate` mode buys (docs/deviations.md).
ablation CASES="30" SEED="1003":
    cargo run --release -p accurate3d --example ablation -- {{CASES}} {{SEED}}

# How often 95 % ellipses hold the truth, over 143 wires of each of 7 families.
coverage WIRES="143" SEED="1905":
    cargo run --release -p accurate-fit --example coverage -- {{WIRES}} {{SEED}}

# The book, if mdbook is installed.
book:
    mdbook build docs

# Trains the segmentation network, or goes on training it (Python with training/requirements.lock; docs/training.md).
train COUNT="4096" *ARGS="":
    cargo run --release -- synth xray --shards out/shards/validation --count 64 --seed 1500
    cargo run --release -- synth xray --shards out/shards/training --count {{COUNT}} --seed 2000
    PYTHONPATH=training OMP_WAIT_POLICY=PASSIVE GOMP_SPINCOUNT=0 python -m accurate_training train \
        --shards out/shards/training --validation out/shards/validation --run out/run {{ARGS}}
