# WebAssembly: the decoder as one file that imports nothing, as small as it can be, and the core's tests as a program
# that Node runs.
#
# What the flags bring, in bytes of the compressed file: addresses are computed where they are used (no LSR), 3 %; loads
# stay where they are (no PRE), 1 %; only what becomes smaller is inlined where time does not matter, 4 %; numbers take as
# few bytes as they need (--compress-relocations), 1 %.
target_compile_options(rules INTERFACE -Oz -msimd128 -fno-exceptions "SHELL:-mllvm -disable-lsr"
                       "SHELL:-mllvm -enable-load-pre=false")
set(COLD ${SOURCES})
list(FILTER COLD EXCLUDE REGEX "/(classic/decoder|codec/effort_layers|diff/code_diff)\\.cpp$")
set_source_files_properties(${COLD} PROPERTIES COMPILE_OPTIONS "-mllvm;-inline-threshold=1")
target_link_options(rules INTERFACE -Oz) # which the library of C++ is built with, too

add_library(core OBJECT ${SOURCES})
target_link_libraries(core PUBLIC rules)

set(FUNCTIONS
  malloc free mt_last_failure
  mt_stream_parse mt_stream_free mt_stream_header
  mt_states_new mt_states_free mt_states_load
  mt_decoder_new mt_decoder_free mt_decoder_push mt_decoder_available mt_decoder_exact mt_decoder_changed
  mt_decoder_show)
list(TRANSFORM FUNCTIONS PREPEND --export= OUTPUT_VARIABLE EXPORTS)

# Linked without any library: what these functions do not need is left out. The stack is in front of everything else, so
# that it traps where it ends. Nothing in the file depends on where or when it was made.
add_library(runtime OBJECT wasm/runtime.cpp)
target_link_libraries(runtime PRIVATE rules)
target_compile_options(runtime PRIVATE -fno-builtin-malloc)
set(FILE ${CMAKE_CURRENT_BINARY_DIR}/meshtide.wasm)
add_custom_command(
  OUTPUT ${FILE}
  COMMAND ${CMAKE_CXX_COMPILER} -m ziglang wasm-ld --no-entry --strip-all --compress-relocations --stack-first
    -z stack-size=1048576 ${EXPORTS} -o ${FILE} $<TARGET_OBJECTS:core> $<TARGET_OBJECTS:runtime>
  DEPENDS $<TARGET_OBJECTS:core> $<TARGET_OBJECTS:runtime>
  COMMAND_EXPAND_LISTS VERBATIM)
add_custom_target(meshtide ALL DEPENDS ${FILE})
add_dependencies(meshtide core runtime)

add_executable(core_tests ${TESTS})
target_link_libraries(core_tests PRIVATE core)
target_link_options(core_tests PRIVATE -Wl,--export=mt_last_failure -Wl,--export=__stack_pointer -Wl,--export-table)
set_target_properties(core_tests PROPERTIES SUFFIX .wasm)

set(NODE node ${CMAKE_CURRENT_SOURCE_DIR}/tests/run_wasm.mjs)
add_test(NAME core_tests_wasm COMMAND ${NODE} tests $<TARGET_FILE:core_tests>)
add_test(NAME decoder_wasm COMMAND ${NODE} decoder ${FILE})
