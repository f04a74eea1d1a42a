# Build: docker build -t turnaround .
# Run:   docker run --rm turnaround keys generate > first.key
#        docker run --rm -p 8080:8080 -v turnaround-data:/data -v ./first.key:/run/first.key:ro \
#            -e TURNAROUND_FIRST_KEY_FILE=/run/first.key turnaround

FROM node:18-bookworm-slim AS page
WORKDIR /build/web
COPY web/package.json web/package-lock.json ./
RUN npm ci --no-audit --no-fund
COPY api /build/api
COPY web ./
RUN npm run --silent build

FROM rust:1.95-bookworm AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends clang libclang-dev libopencv-dev pkg-config \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /build
COPY . .
COPY --from=page /build/web/dist web/dist
RUN cargo build --release --locked && strip target/release/turnaround

FROM debian:bookworm-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates curl \
        libopencv-calib3d406 libopencv-features2d406 libopencv-flann406 libopencv-imgproc406 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --home-dir /data --create-home turnaround
COPY --from=build /build/target/release/turnaround /usr/local/bin/turnaround
USER turnaround
VOLUME /data
EXPOSE 8080
ENV TURNAROUND_LISTEN=0.0.0.0:8080 TURNAROUND_DATA_DIR=/data TURNAROUND_LOG_FORMAT=json
HEALTHCHECK --interval=30s --timeout=5s --start-period=5s \
    CMD curl --fail --silent --output /dev/null http://127.0.0.1:8080/health/ready
ENTRYPOINT ["turnaround"]
CMD ["serve"]
