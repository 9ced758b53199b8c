# Copies the libraries that programs load, but for those that belong to the system: the C and C++ runtime, and what a
# graphics driver shares with its host.
#     cmake "-DPROGRAMS=a;b" -DDESTINATION=<folder> -P …
set(of_the_system
  "^ld-linux" "^lib(c|m|dl|rt|pthread|resolv|util)\\.so" "^lib(stdc\\+\\+|gcc_s)\\.so"
  "^lib(GL|GLX|EGL|OpenGL|GLdispatch|X|xcb|drm)")
file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${PROGRAMS}
  RESOLVED_DEPENDENCIES_VAR found UNRESOLVED_DEPENDENCIES_VAR missing PRE_EXCLUDE_REGEXES ${of_the_system})
if(missing)
  message(FATAL_ERROR "libraries that were not found: ${missing}")
endif()
file(MAKE_DIRECTORY ${DESTINATION})
foreach(library ${found})
  cmake_path(GET library FILENAME name)  # what the loader asks for; the file itself may be called otherwise
  file(REAL_PATH ${library} file)
  file(COPY_FILE ${file} ${DESTINATION}/${name})
endforeach()
list(LENGTH found count)
message(STATUS "${count} libraries in ${DESTINATION}")
