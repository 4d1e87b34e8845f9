# SPDX-License-Identifier: Apache-2.0
#
# `cpack -G DEB` in a build tree makes the Debian packages nephos, libnephos-dev and, where their parts are built,
# nephos-editor, nephos-mpi and python3-nephos. tests/packaging/ installs them into a root of their dependencies alone.

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME nephos)
set(CPACK_PACKAGE_CONTACT "The nephos authors <nephos@example.invalid>")
set(CPACK_PACKAGE_VENDOR "The nephos authors")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL nephos dev)
if(TARGET nephos-editor)
    list(APPEND CPACK_COMPONENTS_ALL editor)
endif()
if(TARGET nephos_mpi)
    list(APPEND CPACK_COMPONENTS_ALL mpi)
endif()
if(TARGET nephos_python)
    list(APPEND CPACK_COMPONENTS_ALL debian_python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)  # libraries that programs link to
set(CPACK_DEBIAN_PACKAGE_SECTION science)

set(CPACK_DEBIAN_NEPHOS_PACKAGE_NAME nephos)
set(CPACK_COMPONENT_NEPHOS_DESCRIPTION "The command `nephos`: grows clouds in a cellular automaton, and turns them into OpenVDB density grids, pictures and
statistics.")
set(CPACK_DEBIAN_NEPHOS_PACKAGE_RECOMMENDS "mesa-vulkan-drivers")
set(CPACK_DEBIAN_NEPHOS_PACKAGE_SUGGESTS "ffmpeg")

set(CPACK_DEBIAN_EDITOR_PACKAGE_NAME nephos-editor)
set(CPACK_COMPONENT_EDITOR_DESCRIPTION "The window of `nephos edit`: shows a scene live while it is changed.")
set(CPACK_DEBIAN_EDITOR_PACKAGE_DEPENDS "nephos (= ${PROJECT_VERSION}), fonts-dejavu-core")
set(CPACK_DEBIAN_EDITOR_PACKAGE_RECOMMENDS "mesa-vulkan-drivers")

set(CPACK_DEBIAN_MPI_PACKAGE_NAME nephos-mpi)
set(CPACK_COMPONENT_MPI_DESCRIPTION "The program nephos-mpi: one lattice over several processes.")
set(CPACK_DEBIAN_MPI_PACKAGE_DEPENDS "openmpi-bin")

set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_NAME python3-nephos)
set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_COMPONENT_DEBIAN_PYTHON_DESCRIPTION "The Python module: steps scenes and gives their bits, density, statistics and pictures as NumPy arrays.")
# The module fits the version of Python whose headers it was compiled with.
if(NEPHOS_PYTHON_DIR MATCHES "python3[.]([0-9]+)")
    math(EXPR next "${CMAKE_MATCH_1} + 1")
    set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_DEPENDS
        "python3 (>= 3.${CMAKE_MATCH_1}), python3 (<< 3.${next}), python3-numpy")
endif()

# Whoever links our static libraries links to what they were built with: the libraries of packages.txt.
file(STRINGS packages.txt build_packages REGEX "^build +[^ ]+-dev ")
set(dev_depends "")
foreach(line IN LISTS build_packages)
    string(REGEX REPLACE "^build +([^ ]+).*" "\\1" package "${line}")
    if(NOT package STREQUAL libgtest-dev)
        list(APPEND dev_depends "${package}")
    endif()
endforeach()
list(JOIN dev_depends ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libnephos-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_DEV_DESCRIPTION "Static libraries and headers: automaton, density, renderer and engine, for find_package(nephos).")

include(CPack)
