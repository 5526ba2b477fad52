#!/usr/bin/env bash
# Checks deploy/ with Prometheus' own promtool: the configuration, the rules, their tests, and the queries of the dashboard.
# Without promtool it downloads Debian's, which needs apt and root. If that fails, it says loudly that nothing was checked.
set -euo pipefail
cd "$(dirname "$0")/.."

work=$PWD/target/prometheus
mkdir -p "$work"
promtool=$(command -v promtool || true)
if [ -z "$promtool" ]; then
    promtool=$work/usr/bin/promtool
    if [ ! -x "$promtool" ] && command -v apt-get >/dev/null; then
        (cd "$work" && { apt-get download -qq prometheus || { apt-get update -qq && apt-get download -qq prometheus; }; } &&
            dpkg -x prometheus_*.deb .) >"$work/apt.log" 2>&1 || true
    fi
fi
if [ ! -x "$promtool" ]; then
    echo "*** deploy/ WAS NOT CHECKED: there is no promtool" >&2
    exit 0
fi

# Each query of the dashboard as a rule, with values for Grafana's variables.
python3 - deploy/grafana/dashboards/*.json >"$work/dashboard.yml" <<'PYTHON'
import json
import sys

rules = []
for path in sys.argv[1:]:
    with open(path, encoding="utf-8") as file:
        panels = json.load(file)["panels"]
    for target in (target for panel in panels for target in panel.get("targets", [])):
        query = target["expr"].replace("$__rate_interval", "1m").replace("$pack", "human")
        rules.append({"record": f"dashboard:query:{len(rules)}", "expr": query})
# JSON is YAML.
print(json.dumps({"groups": [{"name": "dashboard", "rules": rules}]}))
PYTHON

# The file with the key for metrics is there only where the server runs.
"$promtool" check config --syntax-only deploy/prometheus.yml
"$promtool" check rules deploy/rules.yml "$work/dashboard.yml"
"$promtool" test rules deploy/rules_test.yml
