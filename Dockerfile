# The server as an image: docker build -t rosbridge-sim . && docker run -p 9090:9090 rosbridge-sim
# Arguments after the image's name are the server's flags. What clients save goes to /data: mount a volume there, or a
# folder that belongs to user 10001. Any base with Python 3.11 or newer and its venv module will do.
ARG BASE_IMAGE=python:3.12-slim

FROM ${BASE_IMAGE} AS build
# moderngl and glcontext have wheels for x86-64 alone: elsewhere they are compiled.
RUN if [ "$(uname -m)" != x86_64 ]; then \
        apt-get update \
        && apt-get install --yes --no-install-recommends g++ libx11-dev \
            $([ "$(command -v python3)" != /usr/bin/python3 ] || echo python3-dev) \
        && rm -rf /var/lib/apt/lists/*; \
    fi
# Dependencies have a layer of their own, which a change of the sources leaves as it is.
COPY pyproject.toml /src/
RUN python3 -c "import tomllib; project = tomllib.load(open('/src/pyproject.toml', 'rb'))['project']; print(*project['dependencies'], *project['optional-dependencies']['sensors'], sep='\n')" > /src/requirements.txt \
    && python3 -m venv /opt/rosbridge-sim \
    && /opt/rosbridge-sim/bin/pip install --no-cache-dir --disable-pip-version-check --requirement /src/requirements.txt
COPY README.md LICENSE /src/
COPY schemas /src/schemas
COPY docs /src/docs
COPY rosbridge_sim /src/rosbridge_sim
RUN /opt/rosbridge-sim/bin/pip install --no-cache-dir --disable-pip-version-check '/src[sensors]' \
    && /opt/rosbridge-sim/bin/pip uninstall --quiet --yes setuptools pip

FROM ${BASE_IMAGE}
ARG VERSION=dev
ARG REVISION=unknown
LABEL org.opencontainers.image.title="rosbridge-sim" \
    org.opencontainers.image.description="A rosbridge v2 server that needs no ROS, with a driving world inside that answers like MORAI SIM: Drive" \
    org.opencontainers.image.licenses="Apache-2.0" \
    org.opencontainers.image.authors="The rosbridge_sim authors" \
    org.opencontainers.image.version="${VERSION}" \
    org.opencontainers.image.revision="${REVISION}"
# EGL and Mesa draw the pictures of cameras on the processor.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
RUN useradd --uid 10001 --user-group --no-create-home --shell /usr/sbin/nologin rosbridge-sim \
    && install --directory --owner=10001 --group=10001 /data
COPY --from=build /opt/rosbridge-sim /opt/rosbridge-sim
ENV PATH=/opt/rosbridge-sim/bin:$PATH \
    ROSBRIDGE_SIM_HOST=0.0.0.0 \
    ROSBRIDGE_SIM_PORT=9090 \
    ROSBRIDGE_SIM_DATA_DIR=/data
USER 10001
VOLUME /data
EXPOSE 9090
# bash asks in 2 ms; only TLS needs Python.
HEALTHCHECK --interval=10s --timeout=3s --start-period=5s CMD ["bash", "-c", "if [[ ${ROSBRIDGE_SIM_CERTFILE:-} ]]; then exec python3 -c \"import os, ssl, urllib.request; urllib.request.urlopen('https://127.0.0.1:' + os.environ['ROSBRIDGE_SIM_PORT'] + '/healthz', timeout=2, context=ssl._create_unverified_context())\"; fi; exec 3<>\"/dev/tcp/127.0.0.1/$ROSBRIDGE_SIM_PORT\" && printf 'GET /healthz HTTP/1.1\\r\\nHost: localhost\\r\\nConnection: close\\r\\n\\r\\n' >&3 && read -r -t 2 _ status _ <&3 && [[ $status == 200 ]]"]
ENTRYPOINT ["rosbridge-sim"]
CMD ["serve"]
