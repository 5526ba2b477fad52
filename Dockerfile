# The image of the server. docs/docker.md explains the build arguments; scripts/image.sh builds and checks it.
ARG BASE_IMAGE=debian:bookworm-slim
ARG RUST_IMAGE=rust:1.95-bookworm

# ONNX Runtime, pinned by hash. RUNTIME is cpu, openvino or gpu.
FROM ${RUST_IMAGE} AS runtime
ARG RUNTIME=cpu
WORKDIR /src
RUN python3 -m pip --version >/dev/null 2>&1 \
    || { apt-get update -qq \
        && apt-get install -y -qq --no-install-recommends python3-pip \
        && rm -rf /var/lib/apt/lists/*; }
COPY scripts scripts
RUN TROUPE_RUNTIME="${RUNTIME}" scripts/get-runtime.sh \
    && mkdir -p /out \
    && cp "$(dirname "$(readlink -f .runtime/libonnxruntime.so)")"/* /out/ \
    && ln -s "$(basename "$(readlink -f .runtime/libonnxruntime.so)")" /out/libonnxruntime.so

# The site of the documentation, which the server serves at /docs.
FROM ${RUST_IMAGE} AS docs
WORKDIR /src
RUN python3 -c 'import ensurepip, venv' 2>/dev/null \
    || { apt-get update -qq \
        && apt-get install -y -qq --no-install-recommends python3-venv \
        && rm -rf /var/lib/apt/lists/*; }
COPY . .
RUN scripts/docs.sh build /out

# The binary. The caches are the builder's: nothing of them is in the image.
FROM ${RUST_IMAGE} AS build
WORKDIR /src
COPY . .
RUN --mount=type=cache,id=troupe-cargo,target=/usr/local/cargo/registry \
    --mount=type=cache,id=troupe-target,target=/src/target \
    cargo build --profile dist --features jemalloc --locked --timings --package troupe-server \
    && install -D target/dist/troupe-server /out/troupe-server \
    && mkdir /out/state /out/credentials

# The server without packs: mount them at /opt/troupe/models.
# No command runs in this stage, so the base image needs no shell: glibc and libstdc++ are enough.
FROM ${BASE_IMAGE} AS server
COPY --from=runtime /out/ /opt/troupe/lib/
COPY --from=build /out/troupe-server /usr/local/bin/troupe-server
COPY --from=docs /out/ /opt/troupe/docs/
COPY LICENSE NOTICE /opt/troupe/
# The one folder that the server's user may write to: uploads and the cache of accuracy checks. Mount a volume there to keep them.
COPY --from=build --chown=10001:10001 /out/state/ /var/lib/troupe/
# For a key that Prometheus reads, where TROUPE_METRICS_KEY names a file in it. Apart, so that Prometheus sees nothing else.
COPY --from=build --chown=10001:10001 /out/credentials/ /var/lib/troupe-credentials/
# Sessions are kept in /var/lib/troupe/PORT, where that folder can be written.
# Whoever reaches the port needs a key: the one that the server prints, or one of the file that TROUPE_KEYS names.
ENV TROUPE_LISTEN=0.0.0.0:8080 \
    TROUPE_WITHOUT_KEYS=one-time-key \
    TROUPE_PACKS=/opt/troupe/models \
    TROUPE_STYLES=/var/lib/troupe/styles \
    TROUPE_SCENES=/var/lib/troupe/scenes \
    TROUPE_OBJECTS=/var/lib/troupe/objects \
    TROUPE_DOCS=/opt/troupe/docs \
    TROUPE_CACHE=/var/lib/troupe/cache \
    XDG_STATE_HOME=/var/lib \
    ORT_DYLIB_PATH=/opt/troupe/lib/libonnxruntime.so \
    NVIDIA_VISIBLE_DEVICES=all \
    NVIDIA_DRIVER_CAPABILITIES=compute,utility
LABEL org.opencontainers.image.title="Troupe" \
      org.opencontainers.image.description="Motion server: live characters and motion in-betweening over gRPC, HTTP and WebSocket" \
      org.opencontainers.image.licenses="Apache-2.0"
WORKDIR /opt/troupe
USER 10001:10001
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s --retries=3 CMD ["/usr/local/bin/troupe-server", "health"]
ENTRYPOINT ["/usr/local/bin/troupe-server"]
CMD []

# The server with the packs of this repository. Their weights may not be used commercially.
FROM server
COPY models /opt/troupe/models
ARG REVISION=unknown
LABEL org.opencontainers.image.revision="${REVISION}" \
      org.opencontainers.image.licenses="Apache-2.0 AND CC-BY-NC-4.0 AND CC-BY-NC-ND-4.0" \
      troupe.weights="Non-commercial use only, but for open: the licences of the packs' weights are below, their credits in /opt/troupe/NOTICE" \
      troupe.weights.human="CC BY-NC 4.0, non-commercial" \
      troupe.weights.open="Apache-2.0" \
      troupe.weights.g1="CC BY-NC-ND 4.0, non-commercial, no derivatives" \
      troupe.weights.unimogen="CC BY-NC-ND 4.0, non-commercial, no derivatives" \
      troupe.weights.vermo="CC BY-NC 4.0, non-commercial"
