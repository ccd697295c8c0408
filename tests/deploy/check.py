#!/usr/bin/env python3
"""What has to be true of the files in docker/ by which several daemons are run.

  check.py compose FILE          of a compose file
  check.py guide FILE            docs/cluster.md names the paths that one daemon has
  check.py chart < MANIFESTS     of a chart's manifests, as `helm template` renders them
  check.py metrics FILE...       alert rules and dashboards name metrics that the daemon has
"""
import json
import os
import re
import sys

import wing
import yaml

checks = 0


def check(is_true, what):
    global checks
    if not is_true:
        sys.exit(f"tests/deploy: {what}")
    checks += 1


def health_of_image(compose):
    with open(os.path.join(os.path.dirname(compose), "Dockerfile"), encoding="utf-8") as text:
        command = re.search(r"^HEALTHCHECK [^[]*CMD (\[.*\])$", text.read(), re.MULTILINE)
    check(command, "the image says nothing of its health")
    return json.loads(command[1])


def check_nginx(folder, service):
    """Each group of servers that nginx.conf passes requests to is one of upstream.conf's."""
    read = {}
    for mount in service["volumes"]:
        source, target = mount.split(":")[:2]
        if target.startswith("/etc/nginx/") and target.endswith(".conf"):
            with open(os.path.join(folder, source), encoding="utf-8") as text:
                read[target] = text.read()
    main = read["/etc/nginx/nginx.conf"]
    servers = dict(re.findall(r"^upstream (\w+) \{(.*?)^\}", read["/etc/nginx/upstream.conf"],
                              re.MULTILINE | re.DOTALL))
    check(set(re.findall(r"proxy_pass http://(\w+)[;/]", main)) == set(servers),
          "nginx passes requests to other servers than there are")
    orders = re.search(r"location ~ (\S+) \{\s*proxy_pass http://iso_orders;", main)
    check(orders, "nginx does not tell orders apart")
    for path, is_wing in wing.paths().items():
        check(bool(re.search(orders[1], path)) == is_wing, f"nginx passes {path} to the wrong daemons")
    check(len(re.findall(r"^\s*server ", servers["iso_orders"], re.MULTILINE)) == 1,
          "several daemons get orders")


def check_compose(file):
    with open(file, encoding="utf-8") as text:
        compose = yaml.safe_load(text)
    services = compose["services"]
    daemons = {name: service for name, service in services.items() if service["image"] == "isomesh"}
    check(daemons, "no daemon")
    check_nginx(os.path.dirname(file), services["nginx"])
    for name, service in daemons.items():
        check(service["read_only"], f"{name} may write to its root")
        check(service["cap_drop"] == ["ALL"], f"{name} has capabilities")
        check("no-new-privileges:true" in service["security_opt"], f"{name} may get privileges")
        # Without one of its own it has the image's.
        asked = service["healthcheck"]["test"] if "healthcheck" in service else health_of_image(file)
        check("/readyz" in asked[-1], f"{name} is not asked whether it is ready")
        check(service["stop_grace_period"] == "45s", f"{name} is not given the time to drain")
        # Otherwise nginx is the address of every client, in the audit trail and where addresses share places.
        network = compose.get("networks", {}).get("default", {}).get("ipam", {}).get("config", [{}])[0].get("subnet")
        check(service["environment"].get("ISOMESH_TRUSTED_PROXY") == (network or "unix"), f"{name} does not trust nginx")
    for name, service in services.items():
        for place in service.get("volumes", []):
            source = place.split(":")[0]
            check(source.startswith((".", "/")) or source in compose["volumes"],
                  f"{name} has the volume {source}, which nobody declares")
        for needed in service.get("depends_on", []):
            check(needed in services, f"{name} depends on {needed}, which is not there")
    stores = {name: {key: value for key, value in service["environment"].items()
                     if key in ("ISOMESH_STORE", "ISOMESH_BLOBS")} for name, service in daemons.items()}
    check(len({str(sorted(store.items())) for store in stores.values()}) == 1,
          "the daemons have not the same stores")
    if len(daemons) > 1:
        check(all(len(store) == 2 for store in stores.values()), "daemons have stores of their own")


def check_guide(file):
    """docs/cluster.md names what a load balancer has to tell apart."""
    with open(file, encoding="utf-8") as text:
        sentence = re.search(r"Every daemon takes every request, except those to (.*?):", text.read(), re.DOTALL)
    check(sentence and set(re.findall(r"`(.*?)`", sentence[1])) == set(wing.roots()),
          f"{file} does not name the paths of orders: {wing.roots()}")


def check_chart():
    kinds = {}
    for manifest in yaml.safe_load_all(sys.stdin):
        if manifest:
            kinds.setdefault(manifest["kind"], []).append(manifest)
    deployment = kinds["Deployment"][0]["spec"]
    pod = deployment["template"]["spec"]
    container = pod["containers"][0]
    labels = deployment["template"]["metadata"]["labels"]
    matched = [deployment["selector"]["matchLabels"], kinds["Service"][0]["spec"]["selector"],
               kinds["PodDisruptionBudget"][0]["spec"]["selector"]["matchLabels"]]
    check(all(selector.items() <= labels.items() for selector in matched), "selectors find no pod")
    check(container["readinessProbe"]["httpGet"]["path"] == "/readyz", "readiness")
    check(container["livenessProbe"]["httpGet"]["path"] == "/livez", "liveness")
    check("exec" in container["lifecycle"]["preStop"], "preStop")
    environment = {entry["name"]: entry for entry in container["env"]}
    for name, entry in environment.items():
        check(not re.fullmatch(r"[\d.]+e[+-]?\d+", entry.get("value", "")), f"{name} is no number for the daemon")
    check(pod.get("enableServiceLinks") is False, "variables of Kubernetes look like options")
    drain = int(environment["ISOMESH_DRAIN_SECONDS"]["value"])
    check(pod["terminationGracePeriodSeconds"] > drain + 5, "a pod is killed while it drains")
    check(pod["securityContext"]["runAsNonRoot"], "root")
    security = container["securityContext"]
    check(security["readOnlyRootFilesystem"], "the root may be written to")
    check(not security["allowPrivilegeEscalation"], "privileges")
    check(security["capabilities"]["drop"] == ["ALL"], "capabilities")
    check("secretKeyRef" in environment["ISOMESH_STORE"]["valueFrom"], "the password is no secret")
    volumes = {volume["name"]: volume for volume in pod["volumes"]}
    mounts = {mount["name"]: mount["mountPath"] for mount in container["volumeMounts"]}
    check(set(mounts) == set(volumes), "volumes and mounts differ")
    check(mounts["data"] == "/var/lib/isomesh", "there is no room for data")
    check("ephemeral" in volumes["data"], "the daemon does not see how much room it has")
    if "HorizontalPodAutoscaler" in kinds:
        check("replicas" not in deployment, "two things say how many daemons there are")
        metric = kinds["HorizontalPodAutoscaler"][0]["spec"]["metrics"][0]["object"]["metric"]["name"]
        check(metric == "isomesh_queued_jobs", "the autoscaler asks for another metric")
    else:
        check(deployment["replicas"] == 3, "replicas")


def check_metrics(files):
    server = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "server")
    known = set()
    for folder, _, names in os.walk(server):
        for name in names:
            if name.endswith(".cpp"):
                with open(os.path.join(folder, name), encoding="utf-8") as text:
                    known |= set(re.findall(r'"(isomesh_\w+)"', text.read()))
    for file in files:
        with open(file, encoding="utf-8") as text:
            content = text.read()
        used = set(re.findall(r"\bisomesh_\w+", content))
        check(used, f"{file} names no metric")
        for metric in used:
            check(metric in known or metric.removesuffix("_bucket") in known, f"{file} names {metric}, which the daemon lacks")
    with open(files[-1], encoding="utf-8") as text:
        panels = json.load(text)["panels"]
    check(len({panel["id"] for panel in panels}) == len(panels), "panels have the same id")
    places = {(panel["gridPos"]["x"], panel["gridPos"]["y"]) for panel in panels}
    check(len(places) == len(panels), "panels lie on each other")


if sys.argv[1] == "compose":
    check_compose(sys.argv[2])
elif sys.argv[1] == "guide":
    check_guide(sys.argv[2])
elif sys.argv[1] == "metrics":
    check_metrics(sys.argv[2:])
else:
    check_chart()
print(f"{checks} checks")
