# SPDX-License-Identifier: Apache-2.0
#
# Installs the build tree BUILD of SOURCE_ROOT to a temporary prefix under WORK, builds the programs of
# tests/apps/consumer (SOURCE) against it with GENERATOR, COMPILER and FLAGS, those of the build, and runs them.

file(REMOVE_RECURSE "${WORK}")
file(MAKE_DIRECTORY "${WORK}")
set(prefix "${WORK}/prefix with a space")

function(run label)
    execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(NOT status EQUAL 0)
        message(FATAL_ERROR "${label}: status ${status}\n${output}")
    endif()
    set(output "${output}" PARENT_SCOPE)
endfunction()

function(expect_file path)
    if(NOT EXISTS "${prefix}/${path}")
        message(FATAL_ERROR "not installed: ${path}")
    endif()
endfunction()

run("install" "${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${prefix}")
foreach(file bin/nephos include/nephos/automaton/automaton.h include/nephos/density/smoothing.h
        include/nephos/render/renderer.h include/nephos/scenes/format/reader.h share/nephos/scenes/cumulus.toml
        share/nephos/scenes/nephos.schema.json share/bash-completion/completions/nephos
        share/zsh/site-functions/_nephos share/fish/vendor_completions.d/nephos.fish share/doc/nephos/LICENSE)
    expect_file("${file}")
endforeach()

# Warnings and arithmetic flags are the project's own business.
file(GLOB_RECURSE exported "${prefix}/nephosTargets*.cmake")
if(NOT exported)
    message(FATAL_ERROR "no exported targets under ${prefix}")
endif()
foreach(file IN LISTS exported)
    file(READ "${file}" text)
    foreach(word -Wall -Werror -ffp-contract INTERFACE_COMPILE_OPTIONS "${BUILD}" "${SOURCE_ROOT}")
        string(FIND "${text}" "${word}" at)
        if(NOT at EQUAL -1)
            message(FATAL_ERROR "${file} exports ${word}")
        endif()
    endforeach()
endforeach()

# The installed command works from there, with an installed scene.
run("installed command" "${prefix}/bin/nephos" hash "${prefix}/share/nephos/scenes/cumulus.toml" --steps 1)
if(NOT output MATCHES "^0 [0-9a-f]+\n1 [0-9a-f]+\n$")
    message(FATAL_ERROR "the installed command printed: ${output}")
endif()

function(consumer name)
    run("configure ${name}" "${CMAKE_COMMAND}" -S "${SOURCE}" -B "${WORK}/${name}" -G "${GENERATOR}"
        "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DCMAKE_PREFIX_PATH=${prefix}" -DCMAKE_BUILD_TYPE=Release
        "-DCMAKE_CXX_FLAGS=${FLAGS}" ${ARGN})
    run("build ${name}" "${CMAKE_COMMAND}" --build "${WORK}/${name}")
endfunction()

# A program that steps an automaton and writes a grid.
consumer(full)
run("run full" "${WORK}/full/consumer" "${WORK}/cloud.vdb")
string(REGEX MATCH "^[0-9a-f]+" full_hash "${output}")
string(REGEX MATCH " ([0-9]+)" voxels "${output}")
set(voxels "${CMAKE_MATCH_1}")
run("info" "${prefix}/bin/nephos" info --json "${WORK}/cloud.vdb")
if(NOT output MATCHES "\"name\": \"density\"")
    message(FATAL_ERROR "nephos info of the consumer's grid: ${output}")
endif()

# One that needs nothing but the automaton, on a machine without the other libraries.
consumer(automaton -DAUTOMATON_ONLY=ON -DCMAKE_DISABLE_FIND_PACKAGE_OpenVDB=ON
         -DCMAKE_DISABLE_FIND_PACKAGE_Vulkan=ON -DCMAKE_DISABLE_FIND_PACKAGE_OpenEXR=ON)
run("run automaton" "${WORK}/automaton/consumer")
string(STRIP "${output}" automaton_hash)
if(NOT automaton_hash STREQUAL full_hash OR NOT full_hash MATCHES "^[0-9a-f]+$")
    message(FATAL_ERROR "the two programs disagree: ${full_hash} and ${automaton_hash}")
endif()
message(STATUS "${full_hash}, ${voxels} voxels")
