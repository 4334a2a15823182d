# The same commands as the README; the program belongs to root and is run by user 1000, who may write nothing of it.
# Build: docker build -t handscope .   Run: docker run --read-only --tmpfs /tmp -p 127.0.0.1:8420:8420 -v handscope-data:/data handscope
# By digest: make pin-images, or --build-arg PYTHON_IMAGE=python@sha256:...
ARG PYTHON_IMAGE=python:3.11-slim-bookworm
FROM ${PYTHON_IMAGE}

# hadolint ignore=DL3008
RUN apt-get update && apt-get install --yes --no-install-recommends make && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 1000 --create-home handscope && mkdir /data && chown handscope /data
COPY . /home/handscope/app
WORKDIR /home/handscope/app
# Where translated machine code lies while it is made; each start brings it to /tmp, where what another processor needs can be added
ENV NUMBA_CACHE_DIR=/home/handscope/code OPENBLAS_NUM_THREADS=1
RUN make .venv/serves && .venv/bin/python -m compileall -q app estimators handscope sessions static validation
USER 1000:1000
ENV HANDSCOPE_DATA=/data HOME=/tmp NUMBA_CACHE_DIR=/tmp/handscope-code PYTHONDONTWRITEBYTECODE=1
VOLUME /data
EXPOSE 8420
ENTRYPOINT ["sh", "-c", "mkdir -p \"$NUMBA_CACHE_DIR\" && cp -R /home/handscope/code/. \"$NUMBA_CACHE_DIR\" && exec \"$@\"", "--"]
CMD [".venv/bin/handscope", "serve", "--host", "0.0.0.0"]
