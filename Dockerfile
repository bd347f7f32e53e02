# The two commands of the README on a bare machine: they need Python and pip, nothing else.
FROM python:3.13-slim
WORKDIR /proxbench
COPY . .
RUN pip install nox && nox -s bench
RUN pip install nox && nox -s tests
