# Installs the public headers of a library. In the source tree they include each other as "<folder>/x.hpp"; installed they
# say "tissuewarp/<folder>/x.hpp", so that nobody's own core/ or imaging/ is met in their place.
#     cmake -DROOT=<source tree> -DHEADERS=<paths in it, separated by |> -DDESTINATION=<prefix/include/tissuewarp> -P …
string(REPLACE "|" ";" headers "${HEADERS}")
set(folders "core|imaging|meshing|shaders|tled|simulation|registration")
foreach(header ${headers})
  cmake_path(IS_ABSOLUTE header generated)
  if(generated)
    cmake_path(GET header FILENAME name)
    set(source ${header})
    set(target core/${name})
  else()
    set(source ${ROOT}/${header})
    set(target ${header})
  endif()
  file(READ ${source} text)
  string(REGEX REPLACE "#include \"((${folders})/[^\"]+)\"" "#include \"tissuewarp/\\1\"" text "${text}")
  file(WRITE ${DESTINATION}/${target} "${text}")
endforeach()
