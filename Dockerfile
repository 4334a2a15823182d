# The same commands as the README, as an unprivileged user. Build: docker build -t handscope . Run: docker run -p 127.0.0.1:8420:8420 -v handscope-data:/data handscope
FROM python:3.11-slim-bookworm

RUN apt-get update && apt-get install --yes --no-install-recommends make && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home handscope && mkdir /data && chown handscope /data
COPY --chown=handscope . /home/handscope/app
USER handscope
WORKDIR /home/handscope/app
ENV HANDSCOPE_DATA=/data OPENBLAS_NUM_THREADS=1
RUN make .venv/serves
VOLUME /data
EXPOSE 8420
CMD [".venv/bin/handscope", "serve", "--host", "0.0.0.0"]
