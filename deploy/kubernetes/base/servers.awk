# Makes haproxy.cfg fit a cluster: the lines of the third server become lines of all that follow, and addresses are those of pods.
# awk -v servers=8 -v domain=troupe.NAMESPACE.svc.cluster.local -f servers.awk haproxy.cfg
function placed(line, number) {
    gsub("troupe-2", "troupe-" number, line)
    sub(/"\$\{TROUPE_[0-9]+-[^"]*\}"/, "troupe-" number "." domain ":8080", line)
    return line
}
/^ *server troupe-[0-9]+:8080 / {
    match($0, /troupe-[0-9]+/)
    number = substr($0, RSTART + 7, RLENGTH - 7) + 0
    if (number < 2) print placed($0, number)
    if (number == 2) for (i = 2; i < servers; i++) print placed($0, i)
    next
}
{ print }
