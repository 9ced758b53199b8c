# For scripts/* to source once they are in the root: `--help` prints the comment at the top of the script, and so does an
# option that is none of "$options".
for given in "$@"; do
  case " ${options:-} " in *" $given "*) continue ;; esac
  case "$given" in
    -h|--help) status=0 ;;
    -*) status=2; echo "scripts/$(basename "$0"): no option '$given'" >&2 ;;
    *) continue ;;
  esac
  sed -n '2,/^set /s/^# \{0,1\}//p' "scripts/$(basename "$0")" >&$((status == 0 ? 1 : 2))
  exit "$status"
done
