# WebAssembly: the core as one file that imports nothing, and its tests as a program that Node runs.
target_compile_options(rules INTERFACE -Oz -msimd128 -fno-exceptions)
target_link_options(rules INTERFACE -Oz) # which the library of C++ is built with, too

file(STRINGS include/meshtide.h DECLARATIONS REGEX "^MT_API ")
set(EXPORTS -Wl,--export=mt_last_failure)
foreach(DECLARATION IN LISTS DECLARATIONS)
  string(REGEX MATCH "mt_[a-z0-9_]+\\(" NAME "${DECLARATION}")
  string(REPLACE "(" "" NAME "${NAME}")
  list(APPEND EXPORTS -Wl,--export=${NAME})
endforeach()

add_executable(meshtide ${SOURCES})
target_link_libraries(meshtide PRIVATE rules)
target_link_options(meshtide PRIVATE -mexec-model=reactor -s ${EXPORTS})
set_target_properties(meshtide PROPERTIES SUFFIX .wasm)

add_executable(core_tests ${SOURCES} ${TESTS})
target_link_libraries(core_tests PRIVATE rules)
target_link_options(core_tests PRIVATE -Wl,--export=mt_last_failure)
set_target_properties(core_tests PROPERTIES SUFFIX .wasm)

set(NODE node --no-warnings ${CMAKE_CURRENT_SOURCE_DIR}/tests/run_wasm.mjs)
add_test(NAME core_tests_wasm COMMAND ${NODE} tests $<TARGET_FILE:core_tests>)
add_test(NAME interface_wasm COMMAND ${NODE} interface $<TARGET_FILE:meshtide>)
