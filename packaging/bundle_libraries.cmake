# Copies the libraries that programs load, but for those that belong to the system: the C and C++ runtime, and what a
# graphics driver shares with its host.
# Their licences come along, as the packages state them that the libraries are from.
#     cmake "-DPROGRAMS=a;b" -DDESTINATION=<folder> -DLICENCES=<folder> -P …
set(of_the_system
  "^ld-linux" "^lib(c|m|dl|rt|pthread|resolv|util)\\.so" "^lib(stdc\\+\\+|gcc_s)\\.so"
  "^lib(GL|GLX|EGL|OpenGL|GLdispatch|X|xcb|drm)")
file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${PROGRAMS}
  RESOLVED_DEPENDENCIES_VAR found UNRESOLVED_DEPENDENCIES_VAR missing PRE_EXCLUDE_REGEXES ${of_the_system})
if(missing)
  message(FATAL_ERROR "libraries that were not found: ${missing}")
endif()
file(MAKE_DIRECTORY ${DESTINATION} ${LICENCES})

# The Debian package that a library is from: it may know the file by the place before /lib moved into /usr, and a library
# of which there are several by the place that the loader's name leads to.
function(copy_licence library)
  file(REAL_PATH ${library} file)
  cmake_path(GET library FILENAME name)
  cmake_path(GET file FILENAME file_name)
  foreach(pattern ${file} /lib/*/${file_name} /lib/*/${name} /usr/lib/*/${name})
    execute_process(COMMAND dpkg-query --search ${pattern} OUTPUT_VARIABLE owner ERROR_QUIET)
    if(owner MATCHES "^([a-z0-9.+-]+)")
      file(COPY_FILE /usr/share/doc/${CMAKE_MATCH_1}/copyright ${LICENCES}/${CMAKE_MATCH_1} ONLY_IF_DIFFERENT)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "no Debian package has ${file}, so its licence is not known")
endfunction()

foreach(library ${found})
  cmake_path(GET library FILENAME name)  # what the loader asks for; the file itself may be called otherwise
  file(REAL_PATH ${library} file)
  file(COPY_FILE ${file} ${DESTINATION}/${name})
  copy_licence(${library})
endforeach()
list(LENGTH found count)
message(STATUS "${count} libraries in ${DESTINATION}")
