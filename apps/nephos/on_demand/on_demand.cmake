# SPDX-License-Identifier: Apache-2.0

# libnephos_volumes.so: all of density and render. The program `nephos` calls it through functions.S.
enable_language(ASM)

set(providers nephos_density nephos_render)
set(users nephos_app nephos_study nephos_simulation nephos_scenes nephos_metar nephos_seeds nephos_statistics
    nephos_render_options nephos_automaton nephos_core)
set(boundary "${CMAKE_CURRENT_BINARY_DIR}/on_demand")
set(provider_files "")
set(user_files "")
foreach(target IN LISTS providers)
    list(APPEND provider_files "$<TARGET_FILE:${target}>")
endforeach()
foreach(target IN LISTS users)
    list(APPEND user_files "$<TARGET_FILE:${target}>")
endforeach()
file(MAKE_DIRECTORY "${boundary}")
set(lists "${boundary}/volume_functions.list" "${boundary}/exports.map" "${boundary}/wanted.options")
add_custom_command(OUTPUT ${lists}
    COMMAND sh "${CMAKE_CURRENT_SOURCE_DIR}/on_demand/boundary.sh" "${CMAKE_NM}" ${lists} ${provider_files} -- ${user_files}
    DEPENDS on_demand/boundary.sh ${providers} ${users}
    COMMENT "Listing the functions that are loaded on demand" VERBATIM)
add_custom_target(nephos_boundary DEPENDS ${lists})

file(WRITE "${boundary}/volumes.cpp" "// All of the library is in the static libraries that it holds.\n")
add_library(nephos_volumes MODULE "${boundary}/volumes.cpp")
target_link_libraries(nephos_volumes PRIVATE ${providers})
target_link_options(nephos_volumes PRIVATE "@${boundary}/wanted.options" "LINKER:--version-script=${boundary}/exports.map"
                    LINKER:--as-needed LINKER:--no-undefined)
# As far from the program in the build tree as where they are installed: it looks for the library from its own place.
set_target_properties(nephos_volumes PROPERTIES LINK_DEPENDS "${boundary}/exports.map"
    LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/${CMAKE_INSTALL_LIBDIR}/nephos")
set_target_properties(nephos PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/${CMAKE_INSTALL_BINDIR}")
file(RELATIVE_PATH library_folder "/${CMAKE_INSTALL_BINDIR}" "/${CMAKE_INSTALL_LIBDIR}/nephos")
add_dependencies(nephos_volumes nephos_boundary)
install(TARGETS nephos_volumes LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}/nephos")

# The program defines these functions itself, so the linker takes nothing from the static libraries that have them.
target_sources(nephos PRIVATE on_demand/functions.S on_demand/on_demand.cpp)
set_source_files_properties(on_demand/functions.S PROPERTIES OBJECT_DEPENDS "${boundary}/volume_functions.list")
target_include_directories(nephos PRIVATE "$<$<COMPILE_LANGUAGE:ASM>:${boundary}>")
target_compile_definitions(nephos PRIVATE
    "$<$<COMPILE_LANGUAGE:CXX>:NEPHOS_VOLUMES_LIBRARY=\"${library_folder}/$<TARGET_FILE_NAME:nephos_volumes>\">")
target_link_options(nephos PRIVATE LINKER:--as-needed)
target_link_libraries(nephos PRIVATE ${CMAKE_DL_LIBS})
add_dependencies(nephos nephos_volumes nephos_boundary)
