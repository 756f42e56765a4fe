# One image for every container of docker-compose.yml: companion, emulator, judge and broker.
#
# Python packages are pinned by constraints.txt, system packages by the release of Debian: its mirrors keep no older
# versions than the newest fix of each.
ARG BASE_IMAGE=debian:bookworm-slim

# What runs, and what builds on top of that.
FROM ${BASE_IMAGE} AS system
RUN apt-get update \
 && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends \
      ca-certificates mosquitto mosquitto-clients openssl python3 \
 && rm -rf /var/lib/apt/lists/* /var/cache/apt/* /var/cache/debconf/*-old /var/log/*.log /var/log/apt

FROM system AS python
RUN apt-get update \
 && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends python3-venv
RUN python3 -m venv /opt/vfguide
ENV PATH=/opt/vfguide/bin:$PATH \
    PIP_CERT=/etc/ssl/certs/ca-certificates.crt \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PIP_NO_CACHE_DIR=1
WORKDIR /source

# By themselves, so that nothing is downloaded again while they stay the same.
FROM python AS requirements
COPY pyproject.toml ./
RUN python3 -c "import tomllib; p = tomllib.load(open('pyproject.toml', 'rb'))['project']; print(*p['dependencies'], *p['optional-dependencies']['lab'], sep='\n')" \
      > requirements.txt

# Left out: tests of packages, all of MAVLink's dialects but the one that is spoken, 80 MB of them, and what installs
# packages. Compiled is what stays.
FROM python AS build
COPY --from=requirements /source/requirements.txt ./
COPY constraints.txt ./
RUN pip install --quiet --no-compile --only-binary :all: --constraint constraints.txt --requirement requirements.txt \
 && find /opt/vfguide -type d -name tests -prune -exec rm -rf {} + \
 && cd /opt/vfguide/lib/python3*/site-packages/pymavlink/dialects \
 && rm -rf v09 v10 \
 && find v20 -type f ! -name '__init__*' ! -name 'ardupilotmega.*' -delete \
 && find v20 -name '*.xml' -delete
COPY . ./
RUN pip install --quiet --no-compile --no-deps . \
 && pip uninstall --quiet --yes pip setuptools \
 && python3 -m compileall -q /opt/vfguide/lib

FROM system
RUN groupadd --gid 10001 vfguide \
 && useradd --uid 10001 --gid vfguide --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin vfguide \
 && install --directory --owner vfguide --group vfguide \
      /var/lib/vfguide/broker /var/lib/vfguide/trust /var/lib/vfguide/start /var/lib/vfguide/flight /var/lib/vfguide/state /var/lib/vfguide/record /var/lib/vfguide/roster
COPY docker /usr/share/vfguide/docker
# One thread for linear algebra: matrices here are small, and each thread more has its own memory.
ENV PATH=/opt/vfguide/bin:/usr/share/vfguide/docker/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    OPENBLAS_NUM_THREADS=1 \
    MPLCONFIGDIR=/tmp/matplotlib \
    LANG=C.UTF-8
USER 10001:10001
WORKDIR /tmp
CMD ["vfguide", "--help"]
# What changes most often, and takes longest, comes last.
COPY --from=build /opt/vfguide /opt/vfguide
