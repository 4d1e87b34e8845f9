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
        include/nephos/render/renderer.h include/nephos/scenes/format/reader.h
        include/nephos/simulation/simulation.h include/nephos/simulation/frame_painter.h share/nephos/scenes/cumulus.toml
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

# Three programs: one steps an automaton, one writes a scene's densities, one draws its frames. What the last two
# write is what the installed command writes.
consumer(full)
run("step" "${WORK}/full/automaton_only")
string(STRIP "${output}" full_hash)
set(scene "${WORK}/small.toml")
file(WRITE "${scene}" "lattice.cells = [32, 24, 12]\ntime.steps = 4\nseed = 3\n"
     "field.background = {hum = 0.15, act = 0.01, ext = 0.05}\nframes = {per_second = 1, time_scale = 15}\n"
     "camera = {width = 64, height = 48}\nsun.shadow_map_size = 64\n")
run("installed run" "${prefix}/bin/nephos" run "${scene}" --quiet --out "${WORK}/command")
run("vdb_sequence" "${WORK}/full/vdb_sequence" "${scene}" "${WORK}/library")
run("png_frames" "${WORK}/full/png_frames" "${scene}" "${WORK}/library")
function(same_files folder extension)
    file(GLOB names RELATIVE "${WORK}/command/${folder}" "${WORK}/command/${folder}/*${extension}")
    list(LENGTH names count)
    if(count LESS 3)
        message(FATAL_ERROR "the command wrote into ${folder}: ${names}")
    endif()
    foreach(name IN LISTS names)
        run("compare ${name}" "${CMAKE_COMMAND}" -E compare_files "${WORK}/command/${folder}/${name}"
            "${WORK}/library/${folder}/${name}")
    endforeach()
endfunction()
same_files(density .vdb)
same_files(frames .png)

# One that needs nothing but the automaton, on a machine without the other libraries.
consumer(automaton -DAUTOMATON_ONLY=ON -DCMAKE_DISABLE_FIND_PACKAGE_OpenVDB=ON
         -DCMAKE_DISABLE_FIND_PACKAGE_Vulkan=ON -DCMAKE_DISABLE_FIND_PACKAGE_OpenEXR=ON)
run("run automaton" "${WORK}/automaton/automaton_only")
string(STRIP "${output}" automaton_hash)
if(NOT automaton_hash STREQUAL full_hash OR NOT full_hash MATCHES "^[0-9a-f]+$")
    message(FATAL_ERROR "the two programs disagree: ${full_hash} and ${automaton_hash}")
endif()
message(STATUS "${full_hash}")
