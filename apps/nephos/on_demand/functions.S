/* SPDX-License-Identifier: Apache-2.0 */

/* Stands in for the functions of libnephos_volumes.so in the program (docs/adr/0033-start.md), for x86-64 as in the
   System V ABI. A call jumps through the function's slot:

       function:  jmp *slot             slot, at first:       address of `first`
       first:     push number           slot, when loaded:    address of the function in the library
                  jmp resolve

   `resolve` keeps all registers that can hold arguments, has the library loaded, which sets all slots
   (on_demand.cpp), and goes on in the function as if it had been called directly. When loading throws, the exception
   passes through here to the caller. */

    .set number, 0

    .macro FUNCTION name
    .text
    .globl \name
    .type \name, @function
\name:
    .cfi_startproc
    jmp *7f(%rip)
8:  pushq $number
    .cfi_adjust_cfa_offset 8
    jmp resolve
    .cfi_endproc
    .size \name, . - \name
    .section .data.nephos_on_demand, "aw"
7:  .quad 8b
    .section .rodata.nephos_on_demand, "a"
9:  .asciz "\name"
    .section .data.rel.ro.nephos_on_demand, "aw"
    .quad 9b
    .set number, number + 1
    .endm

    .section .data.nephos_on_demand, "aw"
    .balign 8
    .globl nephos_on_demand_slots
    .hidden nephos_on_demand_slots
nephos_on_demand_slots:
    .section .data.rel.ro.nephos_on_demand, "aw"
    .balign 8
    .globl nephos_on_demand_names
    .hidden nephos_on_demand_names
nephos_on_demand_names:

#include "volume_functions.list"

    .section .rodata
    .balign 8
    .globl nephos_on_demand_count
    .hidden nephos_on_demand_count
nephos_on_demand_count:
    .quad number

    .text
    .type resolve, @function
resolve:
    .cfi_startproc
    .cfi_def_cfa_offset 16
    .irp register, rax, rdi, rsi, rdx, rcx, r8, r9, r10
    pushq %\register
    .cfi_adjust_cfa_offset 8
    .endr
    subq $128, %rsp
    .cfi_adjust_cfa_offset 128
    .irp n, 0, 1, 2, 3, 4, 5, 6, 7
    movups %xmm\n, (16 * \n)(%rsp)
    .endr
    movq 192(%rsp), %rdi
    call nephos_on_demand_resolve
    movq %rax, %r11
    .irp n, 0, 1, 2, 3, 4, 5, 6, 7
    movups (16 * \n)(%rsp), %xmm\n
    .endr
    addq $128, %rsp
    .cfi_adjust_cfa_offset -128
    .irp register, r10, r9, r8, rcx, rdx, rsi, rdi, rax
    popq %\register
    .cfi_adjust_cfa_offset -8
    .endr
    addq $8, %rsp
    .cfi_adjust_cfa_offset -8
    jmp *%r11
    .cfi_endproc
    .size resolve, . - resolve

    .section .note.GNU-stack, "", @progbits
