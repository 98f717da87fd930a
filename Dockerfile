FROM python:3.11-slim-trixie AS build
WORKDIR /src
RUN python -m venv /opt/loopaudit
ENV PATH=/opt/loopaudit/bin:$PATH
COPY requirements.lock ./
RUN pip install --no-cache-dir --require-hashes --requirement requirements.lock
COPY pyproject.toml README.md LICENSE ./
COPY app app
COPY workers workers
COPY migrations migrations
RUN pip install --no-cache-dir --no-deps --no-build-isolation .

FROM python:3.11-slim-trixie
# pg_dump and pg_restore of the server's version (docker-compose.yml), which `loopaudit backup` and `restore` call.
RUN apt-get update && apt-get install --yes --no-install-recommends postgresql-client-17 && rm -rf /var/lib/apt/lists/*
RUN useradd --system --uid 10001 --home-dir /var/lib/loopaudit --create-home loopaudit
COPY --from=build /opt/loopaudit /opt/loopaudit
# Compiled kernels are kept where the user may write, a folder for each state of their source; one thread a process,
# the processes are what scales.
ENV PATH=/opt/loopaudit/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    XDG_CACHE_HOME=/var/lib/loopaudit/.cache \
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 \
    LOOPAUDIT_DATA_DIR=/var/lib/loopaudit
USER loopaudit
WORKDIR /var/lib/loopaudit
VOLUME /var/lib/loopaudit
EXPOSE 8000
CMD ["loopaudit", "serve"]
